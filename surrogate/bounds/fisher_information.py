"""How well readings with white noise can tell a touch: Fisher information, material uncertainty, the prior.

For readings dV(theta) + noise of standard deviation s each, the information of theta = (x, y, d, F) is J'J / s^2, and
with a material known to a covariance L L' it is J' (s^2 I + M M')^-1 J, M = (dV/dm) L: what the material may change of
the readings counts as noise. Source: Kay, Fundamentals of Statistical Signal Processing I, 1993, chapters 3 and 15.
"""

from dataclasses import dataclass

import numpy as np

from surrogate.data import outputs
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of the change of the readings by touches; leading axes are any."""

    touch: Array  # (..., readings, 4) by x, y, d, F; V over mm, mm, mm, N
    # (..., readings, m) by the material, V a standard deviation of m independent ones; m = 0 for a known material
    material: Array


@dataclass(frozen=True)
class Prior:
    """Touches uniform over the part of a disc where the punch fits, and over ranges of diameter and force."""

    radius_mm: float  # radius of the disc, mm
    gap_mm: float  # least distance between the punch's edge and the rim, mm
    d_mm: tuple[float, float]  # lowest and highest diameter, mm
    force_N: tuple[float, float]  # lowest and highest force, N

    def reach_mm(self, d_mm: Array | float) -> Array:
        """Largest distance of a punch's axis from the centre."""
        return self.radius_mm - self.gap_mm - np.asarray(d_mm) / 2

    @property
    def variances(self) -> Array:
        """(4,) of x, y, d, F: a uniform disc's reach^2 / 4 at the middle diameter, and range^2 / 12."""
        place = float(self.reach_mm(sum(self.d_mm) / 2)) ** 2 / 4
        return np.array([place, place, *((high - low) ** 2 / 12 for low, high in (self.d_mm, self.force_N))])


def information(slopes: Slopes, noise_V: float) -> Array:
    """(..., 4, 4) Fisher information of (x, y, d, F), the material marginalised (by Woodbury's identity)."""
    by_touch, by_material = slopes.touch, slopes.material
    both = np.swapaxes(by_touch, -1, -2)
    whole = both @ by_touch
    if by_material.shape[-1]:
        within = np.swapaxes(by_material, -1, -2) @ by_material + noise_V**2 * np.eye(by_material.shape[-1])
        shared = both @ by_material
        whole = whole - shared @ np.linalg.solve(within, np.swapaxes(shared, -1, -2))
    return whole / noise_V**2


@dataclass(frozen=True, eq=False)
class Split:
    """An information of (x, y, d, F) as that of the place where the punch is known, and that of the punch alone."""

    place: Array  # (..., 2, 2) covariance of (x, y) where (d, F) is known, mm^2
    follows: Array  # (..., 2, 2) by how much the best (x, y) falls with (d, F): -d(x, y)/d(d, F)
    punch: Array  # (..., 2, 2) information of (d, F), (x, y) marginalised


def split(whole: Array) -> Split:
    """Parts of an information (..., 4, 4)."""
    place = np.asarray(np.linalg.inv(whole[..., :2, :2]), np.float64)
    follows = place @ whole[..., :2, 2:]
    return Split(place, follows, whole[..., 2:, 2:] - whole[..., 2:, :2] @ follows)


def correlation(covariance: Array, one: str, other: str) -> Array:
    """Correlation (...,) of two of x0, y0, d, F in covariances (..., 4, 4)."""
    i, j = outputs.NAMES.index(one), outputs.NAMES.index(other)
    return covariance[..., i, j] / np.sqrt(covariance[..., i, i] * covariance[..., j, j])
