"""Presses of a layer with a force gauge: what they say of its law."""
