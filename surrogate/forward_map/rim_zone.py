"""Where the rim sets in: its share of a touch, 0 as far as a zone begins and 1 from its end on."""

import numpy as np

from touchcal.arrays import Array, Complex

# Radii over the disc's between which what is learned of the rim takes the place of the series, and between which high
# orders of the series end.
ZONE = FROM, FULL = 0.33, 0.40
HIGH_END = 0.50, 0.70
ORDERS = 3  # orders of the series that do not end; higher ones grow without bound near the rim


def part_at(z: Complex, zone: tuple[float, float] = ZONE) -> Array:
    """(n,) the rim's share at places z (n,) over the disc's radius."""
    t = np.clip((np.abs(z) - zone[0]) / (zone[1] - zone[0]), 0, 1)
    return t**2 * (3 - 2 * t)


def part_slope(z: Complex, zone: tuple[float, float] = ZONE) -> Array:
    """(n, 2) derivatives of that share by x and y over the radius."""
    radius = np.abs(z)
    t = np.clip((radius - zone[0]) / (zone[1] - zone[0]), 0, 1)
    by_radius = 6 * t * (1 - t) / (zone[1] - zone[0]) / np.maximum(radius, zone[0])
    return by_radius[:, None] * np.column_stack([z.real, z.imag])


def ended(z: Complex, zone: tuple[float, float], kept: int, base: Array, by_x: Array,
          by_y: Array) -> tuple[Array, Array, Array]:
    """A basis of the series at z (n,) and its slopes, each (n, readings, orders), whose orders above those kept end
    within a zone."""
    part, slope = np.ones((len(z), 1, base.shape[2])), np.zeros((2, len(z), 1, base.shape[2]))
    part[..., kept:] -= part_at(z, zone)[:, None, None]
    slope[..., kept:] -= part_slope(z, zone).T[..., None, None]
    return base * part, by_x * part + base * slope[0], by_y * part + base * slope[1]
