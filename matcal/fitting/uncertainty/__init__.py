"""Linearised intervals of fitted parameters, with nuisance parameters."""
