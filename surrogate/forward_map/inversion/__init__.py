"""From a signal back to the touch."""
