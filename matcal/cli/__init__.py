"""Command line of `matcal`."""
