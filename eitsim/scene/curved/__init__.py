"""Bodies that are not flat: their outer surface as formulas and as triangles, and scenes with them."""
