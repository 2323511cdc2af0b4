"""Report of a data set."""
