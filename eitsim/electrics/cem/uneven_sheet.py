"""A sheet whose conductance varies smoothly, ln(S(x)/S) = sum_k c_k psi_k(x): the rim's potential by its inflow.

Of an even sheet that is K = sum_n (cos n t cos n t' + sin n t sin n t')/n, over pi S. To first order the sheet adds
-1/pi int psi grad(u) . grad(u'), which couples harmonics in closed form; with X that change over the roots of K on
either side, K^(1/2) exp(X) K^(1/2) is taken to second order. It is exact where the sheet changes evenly, and in the
plane the mean of the logarithm is what counts of a conductance that varies.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array

from eitsim.scene.scene import Body
from touchcal.arrays import Array

# psi = r^p cos(q theta) or r^p sin(q theta), r over the radius, less its mean: (p, q, whether it is the sine)
MODES = ((1, 1, False), (1, 1, True), (2, 2, False), (2, 2, True), (2, 0, False))


def sheet_modes(body: Body, points_m: Array) -> Array:
    """(modes, ...) psi at points (..., 2), m, of a skin; r is from its centroid, over the edge's size."""
    middle, second = body.edge.moments_m
    (xx, xy), (_, yy) = second / body.edge.size_m**2
    points, means = (points_m - middle) / body.edge.size_m, [0.0, 0.0, xx - yy, 2 * xy, xx + yy]
    r, angle = np.hypot(points[..., 0], points[..., 1]), np.arctan2(points[..., 1], points[..., 0])
    return np.stack([r**p * (np.sin if sine else np.cos)(q * angle) - mean
                     for (p, q, sine), mean in zip(MODES, means, strict=True)])


@dataclass(frozen=True, eq=False)
class RimChange:
    """What an uneven sheet adds to the potential at some places on the rim by inflow at them, for pi S = 1."""

    kernel: Array  # (M, M)
    slope: Array  # (M, M) its derivative by the angle of the first place
    waves: Array  # (2 h, M) K^(1/2) times the waves at the places
    crossed: Array  # (2 h, M) X times those
    by_mode: tuple[csr_array, ...]  # (2 h, 2 h) dX/dc by each mode

    def by_sheet(self, flow: Array) -> Array:
        """(modes, N, N) derivative by c of the quadratic form of inflows (M, N)."""
        here, once = self.waves @ flow, self.crossed @ flow
        found = []
        for one in self.by_mode:
            change = one @ here
            both = once.T @ change
            found.append(here.T @ change + (both + both.T) / 2)
        return np.stack(found)


def rim_change(angles: Array, modes: Array, harmonics: int) -> RimChange:
    """The change at angles (M,), rad, by c (modes,), so many harmonics around the rim."""
    order, by_mode = np.arange(1, harmonics + 1), _by_mode(harmonics)
    turned = np.outer(order, angles)
    root = 1 / np.sqrt(order)[:, None]
    waves = np.vstack([root * np.cos(turned), root * np.sin(turned)])
    if not modes.any():
        nothing = np.zeros((len(angles), len(angles)))
        return RimChange(nothing, nothing, waves, np.zeros_like(waves), by_mode)
    along = np.vstack([-np.sin(turned) / root, np.cos(turned) / root])
    change = sum((c * one for c, one in zip(modes.tolist(), by_mode, strict=True)), start=0 * by_mode[0])
    crossed = change @ waves
    whole = crossed + change @ crossed / 2
    return RimChange(waves.T @ whole, along.T @ whole, waves, crossed, by_mode)


@lru_cache(maxsize=2)
def _by_mode(harmonics: int) -> tuple[csr_array, ...]:
    """(2 h, 2 h) dX/dc of cosines, then sines, which couples few harmonics, by each mode."""
    out = np.zeros((len(MODES), 2, harmonics, 2, harmonics))
    for found, (p, q, sine) in zip(out, MODES, strict=True):
        low = np.arange(1, harmonics + 1 - q)
        high = low + q
        weight = np.sqrt(low * high) / (2 * low + q + p)
        for one in (0, 1):
            other = 1 - one if sine else one
            value = weight if sine and one else -weight
            found[one, low - 1, other, high - 1] += value
            found[other, high - 1, one, low - 1] += value
            found[one, low - 1, one, low - 1] += _mean(p, q) if q == 0 else 0.0
    return tuple(csr_array(found.reshape(2 * harmonics, 2 * harmonics)) for found in out)


def _mean(p: int, q: int) -> float:
    """Of r^p cos(q theta) over the disc."""
    return 2 / (p + 2) if q == 0 else 0.0
