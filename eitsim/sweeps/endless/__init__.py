"""Frames without end, drawn on the fly from a learned map of touches."""
