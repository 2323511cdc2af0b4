"""Machine files to columns in SI."""
