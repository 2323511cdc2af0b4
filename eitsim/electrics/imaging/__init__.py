"""Difference images of the conductance."""
