"""What changes between two sessions of one skin."""
