"""Rows, frames and the sensor that they belong to."""
