"""Which test to make next: what the card leaves open, tests that a lab can make, and what each is worth."""
