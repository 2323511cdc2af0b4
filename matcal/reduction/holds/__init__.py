"""Ramps and holds of a relaxation, from records of machines and from tables."""
