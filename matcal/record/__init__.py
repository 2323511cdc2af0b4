"""What a calibration leaves behind: the card with its data folder, and predictions with bands."""
