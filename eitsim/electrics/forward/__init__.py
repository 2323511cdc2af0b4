"""From touches to readings."""
