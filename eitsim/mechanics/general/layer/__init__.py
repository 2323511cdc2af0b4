"""A layer under its punches: energy and its minimum, where it starts, and what its surface shows."""
