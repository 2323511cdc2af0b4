"""Many scenes: design, rows, data set, instrument, sensitivity indices."""
