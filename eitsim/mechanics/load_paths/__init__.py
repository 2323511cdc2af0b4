"""Reduced-order tables of load paths, interpolated in place of a solution."""
