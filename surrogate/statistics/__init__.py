"""Gaussian processes, Levenberg-Marquardt, conformal intervals, metrics."""
