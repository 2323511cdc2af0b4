"""The absolute model of a sensor, calibrated to its untouched frame."""
