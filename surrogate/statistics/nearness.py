"""How far a pattern lies from the nearest one that was taught: errors, and with them intervals, grow with it.

The variance of the error is taken as proportional to FLAT + d^2 / u, d being the distance and u the median square of
those of held-out presses. FLAT served two skins of four, at 10 and 20 presses; the others checked it.
"""

from dataclasses import dataclass

import numpy as np

from surrogate.statistics.gaussian_process import squared_distance
from touchcal.arrays import Array, Index

FLAT = 2.0


@dataclass(frozen=True, eq=False)
class Nearness:
    """Patterns that were taught."""

    taught: Array  # (k, m)
    usual: float  # u

    def widening(self, pattern: Array) -> Array:
        """(n,) factor of the intervals of patterns (n, m)."""
        return _widening(squared_distance(pattern, self.taught).min(axis=1), self.usual)


def learn_nearness(pattern: Array, blocks: Index) -> tuple[Nearness, Array]:
    """Nearness to patterns (n, m), and (n,) the factor of each of these where its block is not taught."""
    square = np.empty(len(pattern))
    for block in np.unique(blocks):
        gone = blocks == block
        square[gone] = squared_distance(pattern[gone], pattern[~gone]).min(axis=1)
    usual = max(float(np.median(square)), float(np.finfo(float).tiny))
    return Nearness(pattern, usual), _widening(square, usual)


def _widening(square: Array, usual: float) -> Array:
    return np.sqrt((FLAT + square / usual) / (FLAT + 1))
