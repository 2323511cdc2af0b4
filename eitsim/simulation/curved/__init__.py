"""Scenes on bodies that are not flat: plan, mechanics, skin and electrics."""
