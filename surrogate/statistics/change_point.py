"""Whether what a process learns has a step along one coordinate, where what made the data changes its method.

A step is taken for an input of its own, 0 on one side and SIZE on the other; its place is that of the most evidence
among rows about it, if that is WORTH more than without (Rasmussen and Williams 2006, section 5.4.1).
"""

import numpy as np

from surrogate.statistics import matern_process
from touchcal.arrays import Array, Index

# Step, in lengths of the process, and the gain of log evidence, a quantity, that makes it worth while.
SIZE, WORTH = 0.25, 15.0
# Rows between places that are tried at first; rows on either side that are asked, and fewest.
SPACING, ROWS, FEWEST = 16, 200, 60
NONE = -np.inf  # place of no step


def locate(x: Array, y: Array, along: Array, noise: float) -> float:
    """Where `along` (n,) has a step, for rows of inputs x (n, q) over the lengths and quantities y (n, k) whose noise
    is this part of their amplitude; NONE where it has none."""
    order = np.argsort(along)
    tried = np.arange(FEWEST, len(order) - FEWEST)
    tried = tried[along[order[tried - 1]] < along[order[tried]]]
    if not len(tried):
        return NONE
    best, _ = _best(x, y, order, tried[::SPACING], noise)
    best, gain = _best(x, y, order, tried[np.abs(tried - best) < SPACING], noise)
    return float(along[order[best - 1:best + 1]].mean()) if gain > WORTH * y.shape[1] else NONE


def side(along: Array, place: float) -> Array:
    """(n,) 1 where `along` lies before the step, else 0."""
    return (along < place).astype(float)


def _best(x: Array, y: Array, order: Index, tried: Index, noise: float) -> tuple[int, float]:
    """After how many rows a step gains most, and that gain."""
    gains = [_gain(x, y, order, int(k), noise) for k in tried]
    return int(tried[int(np.argmax(gains))]), max(gains)


def _gain(x: Array, y: Array, order: Index, before: int, noise: float) -> float:
    first = max(before - ROWS, 0)
    rows = order[first:before + ROWS]
    step = np.where(np.arange(len(rows)) >= before - first, SIZE, 0.0)
    return (matern_process.log_evidence(np.column_stack([x[rows], step]), y[rows], noise)
            - matern_process.log_evidence(x[rows], y[rows], noise))
