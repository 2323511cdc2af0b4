"""The learned map from a touch to its signal."""
