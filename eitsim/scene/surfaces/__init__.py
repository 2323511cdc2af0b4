"""Outer surfaces of curved bodies on a rigid core, and how a neighbourhood of each is laid out flat; one file a kind."""
