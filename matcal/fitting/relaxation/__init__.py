"""The Prony series from holds, with the ramp before each, from creep and from dynamic tests."""
