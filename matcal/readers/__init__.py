"""Readers of machine files, one module a vendor."""
