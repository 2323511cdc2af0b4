"""Coordinates in which the effect of a punch is smooth: log d, and the load g = asinh(p / p0), p = F / d^2.

Punches of all diameters press nearly the same at one nominal pressure p, so that functions of g hardly depend on d. g
goes like p for light touches, where effects are proportional to the force, and like log p for heavy ones.
"""

import numpy as np

from touchcal.arrays import Array

LIGHT = 0.1  # part of the training touches that are lighter than p0
MOST, ROWS = 12, 8  # most diameters that are taken for those of known punches, and fewest rows of each


def light_pressure(touch: Array) -> float:
    """p0, N/mm^2, of training touches (n, 4)."""
    return float(np.quantile(touch[:, 3] / touch[:, 2] ** 2, LIGHT))


def to_unknown(touch: Array, p0: float) -> Array:
    """(x, y, d, F) in mm and N -> (x, y, log d, g)."""
    d, force = touch[:, 2], touch[:, 3]
    return np.column_stack([touch[:, :2], np.log(d), np.arcsinh(force / (d**2 * p0))])


def to_touch(unknown: Array, p0: float) -> Array:
    """(x, y, log d, g) -> (x, y, d, F)."""
    d = np.exp(unknown[:, 2])
    return np.column_stack([unknown[:, :2], d, force(unknown[:, 2], unknown[:, 3], p0)])


def force(log_d: Array, load: Array, p0: float) -> Array:
    """F in N of log d and g, any shapes."""
    return p0 * np.sinh(load) * np.exp(2 * log_d)


def touch_slope(unknown: Array, p0: float) -> Array:
    """(n, 4, 4) derivative of (x, y, d, F) by (x, y, log d, g)."""
    d, pressed = np.exp(unknown[:, 2]), force(unknown[:, 2], unknown[:, 3], p0)
    slope = np.zeros((len(unknown), 4, 4))
    slope[:, [0, 1], [0, 1]] = 1.0
    slope[:, 2, 2], slope[:, 3, 2], slope[:, 3, 3] = d, 2 * pressed, pressed / np.tanh(unknown[:, 3])
    return slope


def known_mm(d_mm: Array) -> Array:
    """Diameters of the known punches, increasing; none where training rows have many, one, or few rows of each."""
    values, counts = np.unique(d_mm, return_counts=True)
    return values if 1 < len(values) <= MOST and counts.min() >= ROWS else np.zeros(0)
