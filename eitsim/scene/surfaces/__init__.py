"""Outer surfaces of curved bodies on a rigid core, each laid out flat about a place; one file a kind."""
