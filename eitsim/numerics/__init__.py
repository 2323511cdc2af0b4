"""Linear algebra and Newton minimisation; knows no physics."""
