"""Report of a trained model."""
