"""The complete electrode model on skins with any outline: meshes of triangles, sizes found by the solution itself."""
