"""Conductors that fill a volume: layers with thickness, their electrodes and touches."""
