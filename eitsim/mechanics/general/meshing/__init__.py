"""Meshes of a layer: graded sections revolved about punches, triangles of the outline extruded."""
