"""A trained model in place of the simulator: signals of many touches at once, by NumPy and as a module of torch."""
