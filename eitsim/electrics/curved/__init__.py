"""The complete electrode model on sheets in space, given as triangles."""
