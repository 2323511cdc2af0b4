"""A reader trained on a recording: its scores, its folder, what it says of a recording."""
