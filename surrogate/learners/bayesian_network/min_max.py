"""Min-max scaling, paper eq. 7, onto [-1, 1], where networks of tanh units start well."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array


@dataclass(frozen=True)
class MinMax:
    """Smallest and largest training value of each column."""

    # (q,) unit of the columns
    lowest: Array
    highest: Array

    @property
    def half_span(self) -> Array:
        """(q,) half the range; 1 for a constant column, which scales to 0."""
        half = (self.highest - self.lowest) / 2
        return np.where(half > 0, half, 1.0)


def min_max(values: Array) -> MinMax:
    """The scaling of columns (n, q)."""
    return MinMax(values.min(axis=0), values.max(axis=0))


def scaled(scaling: MinMax, values: Array) -> Array:
    """2 x_hat - 1 with x_hat of eq. 7."""
    return (values - (scaling.lowest + scaling.highest) / 2) / scaling.half_span


def unscaled(scaling: MinMax, values: Array) -> Array:
    """The inverse of `scaled`."""
    return values * scaling.half_span + (scaling.lowest + scaling.highest) / 2
