"""Report of a material card."""
