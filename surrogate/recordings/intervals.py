"""Conformal intervals of places: how far families disagree and templates spread says which frames are surer, held-out
errors say how many of these spreads hold 90 %. Errors along x and y calibrate one factor, each counted as one: few
presses give few errors.
"""

from dataclasses import dataclass

import numpy as np

from surrogate.statistics.conformal import conformal_scale
from touchcal.arrays import Array

FLOORS = (0.3, 1.0, 3.0)  # spread of a frame without any, tried, over the root mean square of held-out errors


@dataclass(frozen=True, eq=False)
class Intervals:
    """Half widths factor sqrt(spread^2 + floor^2)."""

    floor: float  # mm
    factor: float

    def half_width(self, spread: Array) -> Array:
        """(n, 2) half width of the 90 % interval, mm, of spreads (n, 2)."""
        return self.factor * np.sqrt(spread**2 + self.floor**2)


def calibrated(error: Array, spread: Array) -> Intervals:
    """Intervals that hold 90 % of held-out errors (n, 2), mm, of these spreads (n, 2): of the floors tried, the one of
    least mean width."""
    rms = max(float(np.sqrt(np.mean(error**2))), float(np.finfo(float).tiny))
    tried = []
    for floor in (share * rms for share in FLOORS):
        sd = np.sqrt(spread**2 + floor**2)
        factor = float(conformal_scale(error.reshape(-1, 1), sd.reshape(-1, 1), error.size)[0])
        tried.append((float(np.mean(factor * sd)), floor, factor))
    return Intervals(*min(tried)[1:])
