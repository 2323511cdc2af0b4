"""Fewer points from a long record: means of equal or logarithmic blocks, and the noise that such means keep."""

from math import comb

import numpy as np
from numpy.typing import NDArray

from touchcal.arrays import Array

Edges = NDArray[np.intp]


def sample_noise(values: Array, order: int = 2) -> float:
    """Standard deviation of white noise on a record (n,) of straight pieces (of cubic ones with order 4), from its
    differences of that order, robustly."""
    bend = np.diff(values, order)
    return float(1.4826 * np.median(np.abs(bend)) / np.sqrt(comb(2 * order, order))) if bend.size else 0.0


def equal_blocks(n: int, points: int) -> Edges:
    """Edges (m + 1,) of at most about `points` blocks of one size over n samples; a short rest at the start is cut."""
    size = max(1, n // points)
    return np.arange(n % size, n + 1, size)


def log_blocks(time_s: Array, points: int) -> Edges:
    """Edges of at most `points` blocks, equal in the logarithm of the time since the first sample; samples that a clock
    gives one time stay together."""
    t = time_s - time_s[0]
    if t.size < 3:
        return np.arange(t.size + 1)
    if not np.any(t > 0):
        return np.array([0, t.size])
    requested = np.searchsorted(t, np.geomspace(t[t > 0][0], 1.0001 * t[-1], points))
    return np.unique(np.concatenate([[0], requested, [t.size]]))


def block_means(values: Array, edges: Edges) -> Array:
    """Mean of `values` (n,) between neighbouring edges."""
    total = np.concatenate([[0.0], np.cumsum(values - values[0])])
    return values[0] + np.diff(total[edges]) / np.diff(edges)
