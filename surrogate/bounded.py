"""Normal estimates of which one quantity lies between bounds: the mean of the truncated normal distribution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Array = NDArray[np.float64]

# Standard deviations beyond a bound from which it is not believed, as far as errors of the map make one in a hundred
# touches err; and that count as far within.
DOUBTED, FAR = 5.0, 30.0


def held(mean: Array, covariance: Array, column: int, lowest: float, highest: float) -> Array:
    """Means (n, p) of normal estimates of covariances (n, p, p) where one column is known to lie in [lowest, highest],
    the others by their regression on it; as they are where it is DOUBTED standard deviations outside (Johnson, Kotz,
    Balakrishnan, Continuous Univariate Distributions 1, 1994, section 13.10.1)."""
    sd = np.sqrt(np.maximum(covariance[:, column, column], np.finfo(float).tiny))
    below, above = (lowest - mean[:, column]) / sd, (highest - mean[:, column]) / sd
    believed = (below < DOUBTED) & (above > -DOUBTED)
    below, above = np.clip(below, -FAR, DOUBTED), np.clip(above, -DOUBTED, FAR)
    mass = np.where(below > 0, ndtr(-below) - ndtr(-above), ndtr(above) - ndtr(below))
    shift = (np.exp(-0.5 * below**2) - np.exp(-0.5 * above**2)) / np.sqrt(2 * np.pi)
    shift = np.where(believed, shift / np.maximum(mass, np.finfo(float).tiny), 0.0)
    return mean + covariance[..., column] * (shift / sd)[:, None]
