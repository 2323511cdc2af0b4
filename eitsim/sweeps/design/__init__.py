"""Random, listed and nested scenes."""
