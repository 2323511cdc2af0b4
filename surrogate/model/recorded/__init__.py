"""A model of recorded presses: trained, scored, and read with."""
