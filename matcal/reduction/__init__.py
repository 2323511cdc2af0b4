"""Columns of machine files to strain and stress, specimen by specimen."""
