"""Real sensors: their recordings and descriptions, and what the readings say of both."""
