"""Circles about the punch's axis, sampled where they lie inside the disc, and the harmonics of the angle on them.

The angle t counts from the direction to the nearest point of the rim; everything is symmetric about that line, so half
a turn serves. A circle of radius s lies inside a disc of radius R, whose centre is c away, from
cos t = (R^2 - s^2 - c^2)/(2 s c) on. Whole circles have equally spaced angles, which sum harmonics exactly; parts of
one have Gauss points. Harmonics are 1 and sqrt(2) cos m t, or sqrt(2) sin m t: orthonormal in the mean over a circle.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchcal.arrays import Array


@dataclass(frozen=True)
class OffsetDisc:
    """The disc seen from the punch; lengths in any one unit."""

    disc: float  # radius of the disc
    offset: float  # distance of the punch's axis from the disc's centre

    def start(self, radius: Array) -> Array:
        """Angle from which circles of these radii about the axis lie inside the disc: 0 where all of one does."""
        reach = 2 * radius * self.offset
        above = self.disc**2 - radius**2 - self.offset**2
        cosine = np.where(reach > 0, above / np.where(reach > 0, reach, 1.0), np.sign(above))
        return np.arccos(np.clip(cosine, -1.0, 1.0))


@dataclass(frozen=True)
class AngularQuadrature:
    """Sampled circles."""

    weight: Array  # (circles, angles) share of the circle, summing to the part of it that lies inside the disc
    # (circles, harmonics, angles) even and odd harmonics
    cosine: Array
    sine: Array

    @property
    def inside(self) -> Array:
        """Part of each circle (circles,) that lies inside the disc; 1 for whole ones."""
        return self.weight.sum(axis=1)

    @property
    def cut(self) -> NDArray[np.bool_]:
        """Whether the rim cuts a circle (circles,)."""
        return self.inside < 1 - 1e-12


def circles(outline: OffsetDisc, radius: Array, harmonics: int, angles: int) -> AngularQuadrature:
    """Circles of radii (n,) with that many angles, and the harmonics 0 to harmonics - 1 on them."""
    start = outline.start(radius)[:, None]
    t, w = np.polynomial.legendre.leggauss(angles)
    whole, share = start == 0, 1 - start / np.pi
    angle = start + (np.pi - start) * np.where(whole, (np.arange(angles) + 0.5) / angles, (t + 1) / 2)
    return AngularQuadrature(share * np.where(whole, 1 / angles, w / 2), *harmonics_at(angle, harmonics))


def harmonics_at(angle: Array, harmonics: int) -> tuple[Array, Array]:
    """Even and odd harmonics (circles, harmonics, angles) at angles (circles, angles)."""
    m = np.arange(harmonics)[:, None]
    norm = np.where(m == 0, 1.0, np.sqrt(2))
    return norm * np.cos(m * angle[:, None]), norm * np.sin(m * angle[:, None])
