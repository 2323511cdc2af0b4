"""Where to press next."""
