"""Several touches at once, at known places, by superposition of measured patterns."""
