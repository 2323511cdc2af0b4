"""Touches on curved bodies: groups of near ones by coordinates of the surface, a field in space."""
