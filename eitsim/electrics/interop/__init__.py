"""EIDORS models and meshes of users."""
