"""Triangles in space: their files, solids that they bound, and punches of such shapes."""
