"""The source paper walked through, its figures next to ours."""
