"""Frames followed live."""
