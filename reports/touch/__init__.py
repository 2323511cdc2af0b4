"""Report of one touch."""
