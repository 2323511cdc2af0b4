"""Intervals of mixtures of normal variables of two spreads, one below and one above the mode."""

import numpy as np
from scipy.special import ndtr, ndtri

from touchcal.arrays import Array

HALVINGS = 24  # of the range between the ends of the members' own intervals


def interval(mode: Array, below: Array, above: Array, tail: Array | float) -> tuple[Array, Array]:
    """Ends (...) of the intervals outside which, on either side, a part `tail` of mixtures lies, whose members (..., k)
    are equally likely and have these modes and distances to the ends of their own such intervals."""
    normal = -ndtri(tail)
    scale = np.maximum(np.stack([below, above]), np.finfo(float).tiny) / np.expand_dims(normal, -1)

    def end(part: Array | float, low: Array, high: Array) -> Array:
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            off = middle[..., None] - mode
            short = ndtr(off / np.where(off < 0, scale[0], scale[1])).mean(axis=-1) < part
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return (low + high) / 2

    lowest, highest = mode - below, mode + above
    return (end(tail, lowest.min(axis=-1), lowest.max(axis=-1)),
            end(1 - tail, highest.min(axis=-1), highest.max(axis=-1)))
