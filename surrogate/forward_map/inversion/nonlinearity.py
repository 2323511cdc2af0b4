"""How far from straight readings are over a touch's own interval: where they bend, one covariance is too narrow."""

from __future__ import annotations

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.load_coordinates import to_unknown, touch_slope
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array


def relative_curvature(forward: ForwardMap, touch: Array, covariance: Array, whiten: Array) -> float:
    """Departure of the map's readings from their tangent at the ends of the 90 % interval along the longest axis of the
    covariance, the larger of both, over the normal factor: 1 where readings bend by what one standard deviation of the
    touch changes them by, 0 where they are linear (Bates, Watts, J. R. Statist. Soc. B 42 (1980) 1).

    touch (4,) and covariance (4, 4) in mm and N; whiten (readings, readings) makes residuals standard normal.
    """
    here = to_unknown(touch[None], forward.p0)
    to_unknowns = np.linalg.inv(touch_slope(here, forward.p0)[0])
    spread = to_unknowns @ covariance @ to_unknowns.T
    size, axes = np.linalg.eigh(spread / np.outer(forward.sd, forward.sd))
    step = normal(COVERAGE) * np.sqrt(size[-1]) * axes[:, -1] * forward.sd
    found = linearise(forward, np.vstack([here, here + step, here - step]))
    tangent = whiten @ found.jacobian[0] @ step
    moved = (found.signal_V[1:] - found.signal_V[0]) @ whiten.T
    left = moved - np.array([[1.0], [-1.0]]) * tangent
    return float(np.linalg.norm(left, axis=1).max() / normal(COVERAGE))
