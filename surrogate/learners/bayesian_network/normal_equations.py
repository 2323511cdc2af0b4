"""J'J of a network without its Jacobian.

The block of units i and j is X'DX, with X the inputs and a column of ones and D the products of the units' slopes. It
is symmetric, and so is the array of blocks: a quarter of all products is summed over the rows, in one matrix product.
"""

from __future__ import annotations

import numpy as np

from touchcal.arrays import Array, Index

# Rows whose products are formed together, to stay within the cache.
ROWS = 256


def normal_matrix(x: Array, hidden: Array, slope: Array) -> Array:
    """(p, p) lower triangle of J'J in the order of network.layers, for inputs x (n, q), hidden outputs (n, h) and their
    slopes v (1 - tanh^2) (n, h); above the diagonal stands anything."""
    ones = np.ones((len(x), 1))
    x, hidden = np.hstack([x, ones]), np.hstack([hidden, ones])
    units, inputs = slope.shape[1], x.shape[1] - 1
    inner, bias = units * inputs, units * (inputs + 1)
    whole = np.zeros((bias + units + 1, bias + units + 1), order="F")
    places = _places(inputs + 1)
    sums = _pair_sums(slope, x)
    for (i, j), pair in zip(np.argwhere(np.tri(units, dtype=bool)), sums, strict=True):
        block = pair[places]
        whole[i * inputs:(i + 1) * inputs, j * inputs:(j + 1) * inputs] = block[:-1, :-1]
        whole[inner + i, j * inputs:(j + 1) * inputs] = whole[inner + j, i * inputs:(i + 1) * inputs] = block[-1, :-1]
        whole[inner + i, inner + j] = block[-1, -1]
    outer = (hidden[:, :, None] * slope[:, None, :]).reshape(len(x), -1).T @ x
    outer = outer.reshape(units + 1, units, inputs + 1)
    whole[bias:, :inner] = outer[:, :, :-1].reshape(units + 1, inner)
    whole[bias:, inner:bias] = outer[:, :, -1]
    whole[bias:, bias:] = hidden.T @ hidden
    return whole


def _pair_sums(slope: Array, x: Array) -> Array:
    """(h (h + 1) / 2, q (q + 1) / 2) sums over the rows of products of pairs of columns of both."""
    sums = _pairs(slope[:ROWS]).T @ _pairs(x[:ROWS])
    for i in range(ROWS, len(x), ROWS):
        sums += _pairs(slope[i:i + ROWS]).T @ _pairs(x[i:i + ROWS])
    return sums


def _pairs(columns: Array) -> Array:
    """(n, m (m + 1) / 2) products of columns (n, m) with those up to themselves."""
    count = columns.shape[1]
    products = np.empty((len(columns), count * (count + 1) // 2))
    for i in range(count):
        first = i * (i + 1) // 2
        np.multiply(columns[:, i:i + 1], columns[:, :i + 1], out=products[:, first:first + i + 1])
    return products


def _places(count: int) -> Index:
    """(m, m) where _pairs puts the product of each two of m columns."""
    i, j = np.indices((count, count))
    high, low = np.maximum(i, j), np.minimum(i, j)
    return high * (high + 1) // 2 + low
