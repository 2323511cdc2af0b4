"""Energy of a layer and its punches, and its minimum."""
