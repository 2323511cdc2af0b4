"""Slopes of smooth functions by central differences."""

from collections.abc import Callable

import numpy as np

from touchcal.arrays import Array


def slopes(function: Callable[[Array], Array], vector: Array) -> Array:
    """(n, K) central differences of a function of (K,)."""
    steps = 1e-5 * np.eye(vector.size)
    return np.column_stack([(function(vector + s) - function(vector - s)) / 2e-5 for s in steps])
