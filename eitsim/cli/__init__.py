"""Command line of `eitsim`."""
