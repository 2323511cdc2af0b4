"""What an instrument adds to clean readings."""
