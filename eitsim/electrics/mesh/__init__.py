"""Meshes of the skin that follow a touch."""
