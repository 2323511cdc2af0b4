"""What changes between two sessions of one skin, from a few labelled presses of the second."""
