"""Corrections near the rim and by a second punch."""
