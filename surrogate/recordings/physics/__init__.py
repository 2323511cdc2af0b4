"""What physics expects of the patterns of presses, up to gains and to how the sensor lies."""
