"""Report of a calibrated sensor."""
