"""The Prony series from holds, with the ramp before each."""
