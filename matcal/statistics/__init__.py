"""Correlation of residuals, linear marginalisation, block means."""
