"""Split-conformal intervals: how many standard deviations hold so many of the validation rows (Lei et al. 2018)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

Array = NDArray[np.float64]

COVERAGE = 0.90


def normal(coverage: float) -> float:
    """Standard deviations about the mean that hold this part of a normal variable."""
    return float(ndtri((1 + coverage) / 2))


def conformal_scale(error: Array, sd: Array, rows: int, coverage: float = COVERAGE,
                    discrete: NDArray[np.bool_] | None = None) -> Array:
    """(k,) factor of sd (n, k) whose intervals hold this part of errors (n, k) made on `rows` different rows.

    The order statistic is that of `rows` exchangeable errors. Few rows have none (fewer than 9 at 90 %, 19 at 95 %):
    then the largest ratio is taken, or the normal factor where that is larger.

    discrete: (k,) outputs that take one of a few values. Rows sure of theirs have ratios near 0 and say nothing of rows
    in doubt, so the factor of these outputs is never below the normal one.
    """
    ratio = np.abs(error) / np.maximum(sd, np.finfo(float).tiny)
    level = math.ceil((rows + 1) * coverage) / rows
    floored = level > 1 if discrete is None else discrete | (level > 1)
    least = np.where(floored, normal(coverage), 0.0)
    return np.maximum(np.quantile(ratio, min(level, 1.0), axis=0, method="higher"), least)
