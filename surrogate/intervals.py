"""Split-conformal intervals: how many standard deviations hold 90 % of the validation rows (Lei et al. 2018)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COVERAGE = 0.90
# Standard deviations that hold 90 % of a normal variable.
NORMAL = 1.6448536269514722


def conformal_scale(error: Array, sd: Array, rows: int) -> Array:
    """(k,) factor of sd (n, k) whose intervals hold 90 % of errors (n, k) made on `rows` different rows.

    The order statistic is that of `rows` exchangeable errors. Fewer than 9 rows have none at 90 %: then the largest
    ratio is taken, or the normal factor where that is larger.
    """
    ratio = np.abs(error) / np.maximum(sd, np.finfo(float).tiny)
    level = math.ceil((rows + 1) * COVERAGE) / rows
    if level > 1:
        return np.maximum(ratio.max(axis=0), NORMAL)
    return np.quantile(ratio, level, axis=0, method="higher")
