"""Touches learnt from recorded presses."""
