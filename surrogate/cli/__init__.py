"""Command line of `surrogate`."""
