"""Touched layers that conduct in their volume: their readings, from the sections of axisymmetric touches."""
