"""Derivatives of readings by position, force, diameter and card."""
