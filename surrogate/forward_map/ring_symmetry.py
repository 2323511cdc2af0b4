"""The ring's symmetries: turns and mirrors that carry electrodes onto electrodes, and what they do to readings.

A touch is folded into one half-sector, from the middle of electrode 0 to the middle of the next gap, and its readings
with it; so every row teaches the whole ring.
"""

from dataclasses import dataclass

import numpy as np

from surrogate.data.sensor_ring import Ring, impedances_read
from touchcal.arrays import Array, Complex, Index, Mask

TOLERANCE = 1e-9  # how far an electrode or a combination of readings may be from its image, rad and relative
# Part of the largest singular value below which one is zero but for rounding: half of all are, as readings that
# exchange drive and read are equal, and some libraries leave these above numpy's default of 1e-15.
ROUNDING = 1e-10


@dataclass(frozen=True, eq=False)
class Symmetry:
    """All maps z -> turn z and z -> turn conj(z) that keep the ring and its readings."""

    turn: Complex  # (maps,) turns, |turn| = 1
    mirrored: Mask  # (maps,) whether z is mirrored first
    readings: Array  # (maps, readings, readings) readings of the mapped touch by those of the touch


def symmetry_of(ring: Ring) -> Symmetry:
    """The maps of a ring; the identity alone where electrodes or readings have no symmetry.

    A reading is one entry of the symmetric matrix of transfer impedances, so a map is a symmetry where it carries
    all readings onto combinations of readings.
    """
    point = np.exp(1j * ring.angle_rad)
    entries = impedances_read(ring, np.arange(len(point))) / 2
    inverse = np.linalg.pinv(entries, rcond=ROUNDING)
    found: list[tuple[complex, bool, Array]] = []
    for mirrored in (False, True):
        base = point.conj() if mirrored else point
        for turn in point / base[0]:
            image = turn * base
            nearest = np.abs(image[:, None] - point).argmin(axis=1)
            if np.abs(image - point[nearest]).max() > TOLERANCE:
                continue
            moved = impedances_read(ring, np.argsort(nearest)) / 2
            combination = moved @ inverse
            if np.abs(combination @ entries - moved).max() < TOLERANCE:
                found.append((turn, mirrored, combination))
    turns, mirrors, readings = zip(*found, strict=True)
    return Symmetry(np.array(turns), np.array(mirrors), np.array(readings))


def filled_from(ring: Ring, kept: Mask) -> Array:
    """(readings, kept) all readings of a ring by those kept, least in norm where these do not tell: two readings of one
    transfer impedance are equal."""
    entries = impedances_read(ring, np.arange(len(ring.angle_rad))) / 2
    return entries @ np.linalg.pinv(entries[kept], rcond=ROUNDING)


def fold(symmetry: Symmetry, z: Complex) -> tuple[Complex, Index]:
    """Places z (n,) in the half-sector, and the map (n,) that carries each there."""
    images = symmetry.turn * np.where(symmetry.mirrored, z[:, None].conj(), z[:, None])
    angle = np.angle(images)
    angle = np.where(angle < -1e-12, angle + 2 * np.pi, angle)
    chosen = angle.argmin(axis=1)
    return images[np.arange(len(z)), chosen], chosen
