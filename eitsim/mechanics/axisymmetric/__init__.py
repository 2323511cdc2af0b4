"""Indentation about the axis of the punch."""
