"""How an untouched frame walks, learnt from means of blocks of frames, with or without touches between them.

In a second the covariance of the untouched frame grows by Q = root' root + rest I. A mean of n frames over [s, s + l],
of centre c, is off the frame at time 0 by a covariance K_ij Q, K_ij = min(c_i, c_j), K_ii = s_i + l_i / 3, and by
noise r^2 / n_i. Differences D of consecutive means M do not know the frame at time 0. With L L' = D diag(r^2 / n) D',
rows of Y = L^-1 D M have unit noise, and the covariance I + q B along a direction of variance q, B = L^-1 D K D' L^-T.
Changes that physics foresees (of gains, say) have one q, where there is more of them than of others; other directions
are singular vectors of Y whose values exceed what noise alone gives (Marchenko, Pastur, Math. USSR Sb. 1 (1967) 457),
each with a q of its own. Each q is the most likely one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array

CLEAR = 1.1  # singular value over the largest of noise from which a direction walks
SURE = 4.0  # standard deviations of a chi^2 that noise is not believed to give
LEAST_NOISE = 1e-9  # of the readings' r.m.s.: noise, at least
# Part of the largest foreseen change below which one is none, and movement along a foreseen direction over that along
# another one from which those that are foreseen are believed to be what moves.
SMALL, DENSER = 1e-3, 4.0
NULL = 1e-12  # part of the largest growth of variance below which one is none
SCORINGS = 6  # Fisher scorings of q, which end far below its standard error


@dataclass(frozen=True, eq=False)
class Block:
    """Untouched frames one after another."""

    mean: Array  # (readings,)
    frames: int
    begun_s: float  # time of the first
    length_s: float  # from the first to the last


@dataclass(frozen=True, eq=False)
class Walk:
    """What the covariance of the untouched frame grows by in a second."""

    root: Array  # (k, readings): root' root, and
    rest: float  # a variance of each reading

    @property
    def trace(self) -> float:
        """Sum of the variances of all readings."""
        return float(np.sum(self.root**2)) + self.rest * self.root.shape[1]


def still(readings: int) -> Walk:
    """None that is known."""
    return Walk(np.zeros((0, readings)), 0.0)


def walk_of(blocks: Sequence[Block], noise: float, foreseen: Array) -> Walk:
    """The walk by blocks in time order, of frames whose readings have this variance of noise; foreseen are changes (k,
    readings) of independent causes."""
    means = np.array([one.mean for one in blocks])
    if len(blocks) < 2:
        return still(means.shape[1])
    white, kernel = _whitened(blocks, means, max(noise, LEAST_NOISE**2 * float(np.mean(means**2))))
    growth, modes = np.linalg.eigh(kernel)
    if growth[-1] <= 0:  # frames of one time
        return still(means.shape[1])
    growth, seen = np.maximum(growth, NULL * growth[-1]), modes.T @ white
    axes, size = _span(foreseen)
    rate = _rate_of_foreseen(seen, growth, axes, size)
    if not rate:
        return _with_others(foreseen[:0], seen, growth, means.shape[1])
    return _with_others(np.sqrt(rate) * foreseen, seen - seen @ axes.T @ axes, growth, means.shape[1] - len(axes))


def _span(foreseen: Array) -> tuple[Array, Array]:
    """Orthonormal axes (m, readings) of foreseen changes, and their sizes (m,)."""
    _, size, axes = np.linalg.svd(foreseen, full_matrices=False)
    kept = size > SMALL * size.max(initial=0.0)
    return axes[kept], size[kept]


def _rate_of_foreseen(seen: Array, growth: Array, axes: Array, size: Array) -> float:
    """Their q by numbers (rows, readings) of variances 1 + q growth (rows,); 0 where they are not what moves."""
    along, others = seen @ axes.T, seen.shape[1] - len(axes)
    more = float(np.sum(along**2)) - along.size
    elsewhere = float(np.sum(seen**2)) - seen.size - more
    if more < SURE * np.sqrt(2 * along.size) or more * others < DENSER * elsewhere * len(axes) or not len(axes):
        return 0.0
    return _rate(along.ravel(), np.outer(growth, size**2).ravel())


def _with_others(root: Array, seen: Array, growth: Array, readings: int) -> Walk:
    """The walk of a foreseen root and of what else such numbers, of so many free readings, show."""
    rows = len(seen)
    along, size, axes = np.linalg.svd(seen, full_matrices=False)
    kept = np.flatnonzero(size > CLEAR * (np.sqrt(readings) + np.sqrt(rows)))
    # of a squared singular value noise along the other readings makes `readings`: that of the direction's own error
    own = np.sqrt(np.maximum(size[kept] ** 2 - readings, 0.0))
    rate = np.array([_rate(one, growth) for one in (along[:, kept] * own).T])
    left, expected = float(np.sum(size**2) - np.sum(size[kept] ** 2)), rows * readings - len(kept) * (rows + readings)
    more = left - expected if left - expected > SURE * np.sqrt(2 * rows * readings) else 0.0
    rest = more / (readings * float(growth.sum())) + float(np.sum(rate / np.maximum(size[kept] ** 2 - rows, 1.0)))
    return Walk(np.concatenate([root, np.sqrt(rate)[:, None] * axes[kept]]), rest)


def _whitened(blocks: Sequence[Block], means: Array, noise: float) -> tuple[Array, Array]:
    """Y (rows, readings) and B (rows, rows)."""
    begun, length = (np.array([getattr(one, name) for one in blocks]) for name in ("begun_s", "length_s"))
    begun = begun - begun[0]
    centre = begun + length / 2
    walked = np.minimum.outer(centre, centre)
    np.fill_diagonal(walked, begun + length / 3)
    scatter = np.diag(noise / np.array([one.frames for one in blocks]))
    lower = np.linalg.cholesky(_differences(_differences(scatter).T))
    kernel = np.linalg.solve(lower, np.linalg.solve(lower, _differences(_differences(walked).T)).T)
    return np.asarray(np.linalg.solve(lower, _differences(means)), np.float64), np.asarray(kernel, np.float64)


def _differences(rows: Array) -> Array:
    return np.diff(rows, axis=0)


def _rate(seen: Array, growth: Array) -> float:
    """The most likely q of independent numbers (rows,) of variances 1 + q growth."""
    q = max(float(seen @ seen) - len(seen), 0.0) / growth.sum()
    for _ in range(SCORINGS):
        weight = (growth / (1 + q * growth)) ** 2
        q = max(float(np.sum(weight * (seen**2 - 1) / growth) / weight.sum()), 0.0)
    return q
