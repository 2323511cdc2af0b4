"""One frame in depth: the simulator itself, the posterior, two touches."""
