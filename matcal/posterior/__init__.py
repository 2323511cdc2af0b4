"""Sampling of whole parameter sets."""
