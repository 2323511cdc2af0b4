"""Rows solved into parts of a folder, and what that cost."""
