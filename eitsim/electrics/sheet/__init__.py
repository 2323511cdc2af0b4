"""From strain to sheet conductance."""
