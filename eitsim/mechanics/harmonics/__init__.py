"""Fourier discretisation of a disc that is pressed off its centre."""
