"""Where a contact ends, by the gap outside it, which grows as the power 3/2 of the distance from there.

A mesh shows the end by chance within an element, the gap over the next ones far better.
"""

import numpy as np

from touchcal.arrays import Array

# Distances from the last place that touches between which gaps count, in lengths of the element in which contact ends.
NEAREST, FARTHEST = 0.3, 2.0
# By elements of a quarter of the size the end moves by less than so many of these lengths: under round punches in 24 of
# 24 touches on six foams, under flat ones and cones in 71 of 74, elsewhere by up to 1.14 times that.
LEFT, LEFT_BY_EDGE = 1 / 10, 3 / 20


def end_by_gaps(away: Array, gaps: Array) -> Array:
    """Zeros (...) of lines through gaps^(2/3) (..., n) at distances (n,); not a number where the gap does not grow."""
    risen, from_mean = np.maximum(gaps, 0.0) ** (2 / 3), away - away.mean()
    slope = risen @ from_mean / (from_mean @ from_mean)
    return np.where(slope > 0, away.mean() - risen.mean(axis=-1) / np.where(slope > 0, slope, 1.0), np.nan)
