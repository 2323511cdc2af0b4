"""Variance-based sensitivity (Sobol indices)."""
