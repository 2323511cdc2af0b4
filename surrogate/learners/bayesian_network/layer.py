"""One hidden layer of tanh units and one linear output, float64, with its Jacobian by the weights in closed form.

y(x) = v . tanh(W x + b) + c. All weights in one vector w = (W by rows, b, v, c), p = h (q + 2) + 1 numbers for q inputs
and h units. The Jacobian J is n x p; products with it and the n x n matrix J J' never need it whole.
"""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from touchcal.arrays import Array, Index

ROWS = 256  # rows whose products are formed together, to stay within the cache


@dataclass(frozen=True)
class Layers:
    """The weight vector cut into its layers (views)."""

    inner: Array  # (h, q) input weights W
    bias: Array  # (h,) biases b
    outer: Array  # (h,) output weights v
    offset: float  # () output bias c


def layers(w: Array, inputs: int) -> Layers:
    """Cut a weight vector (p,) of a network with `inputs` inputs."""
    units = (len(w) - 1) // (inputs + 2)
    inner, bias, outer = np.split(w[:-1], np.cumsum([units * inputs, units]))
    return Layers(inner.reshape(units, inputs), bias, outer, w[-1])


def initial_weights(inputs: int, units: int, rng: Generator) -> Array:
    """Nguyen-Widrow start for inputs in [-1, 1], as trainbr's networks have it: units of gain 1.4 h^(1/q), active where
    |w x + b| < 2, spread over the inputs (Nguyen and Widrow 1990); output weights uniform in [-1, 1]."""
    gain = 2 * 0.7 * units ** (1.0 / inputs)
    inner = rng.uniform(-1, 1, (units, inputs))
    inner *= gain / np.linalg.norm(inner, axis=1, keepdims=True)
    spread = np.linspace(-1, 1, units) if units > 1 else np.zeros(1)
    return np.concatenate([inner.ravel(), gain * spread * np.sign(inner[:, 0]), rng.uniform(-1, 1, units + 1)])


def turned(w: Array, axes: Array) -> Array:
    """The network on inputs x axes, for axes (q, r): input weights W axes, the others as they are."""
    net = layers(w, len(axes))
    return np.concatenate([(net.inner @ axes).ravel(), w[net.inner.size:]])


def output(w: Array, x: Array) -> Array:
    """(n,) outputs for inputs (n, q)."""
    net = layers(w, x.shape[1])
    return np.tanh(x @ net.inner.T + net.bias) @ net.outer + net.offset


def jacobian(w: Array, x: Array) -> Array:
    """(n, p) derivative of the outputs by the weights."""
    hidden, slope = _hidden(w, x)
    inner = (slope[:, :, None] * x[:, None, :]).reshape(len(x), -1)
    return np.hstack([inner, slope, hidden, np.ones((len(x), 1))])


def kernel(w: Array, x: Array) -> Array:
    """(n, n) J J', without forming J."""
    hidden, slope = _hidden(w, x)
    return (slope @ slope.T) * (1 + x @ x.T) + hidden @ hidden.T + 1


def normal(w: Array, x: Array) -> Array:
    """(p, p) lower triangle of J'J, without forming J."""
    hidden, slope = _hidden(w, x)
    return _normal_matrix(x, hidden, slope)


def times_jacobian(w: Array, x: Array, direction: Array) -> Array:
    """(n,) J direction, for a direction (p,)."""
    hidden, slope = _hidden(w, x)
    move = layers(direction, x.shape[1])
    return (slope * (x @ move.inner.T + move.bias)).sum(axis=1) + hidden @ move.outer + move.offset


def times_transpose(w: Array, x: Array, rows: Array) -> Array:
    """(p,) J' rows, for rows (n,)."""
    hidden, slope = _hidden(w, x)
    weighted = slope * rows[:, None]
    return np.concatenate([(weighted.T @ x).ravel(), weighted.sum(axis=0), rows @ hidden, [rows.sum()]])


def _hidden(w: Array, x: Array) -> tuple[Array, Array]:
    """Hidden outputs (n, h) and output weight times tanh' (n, h)."""
    net = layers(w, x.shape[1])
    hidden = np.tanh(x @ net.inner.T + net.bias)
    return hidden, net.outer * (1 - hidden**2)


def _normal_matrix(x: Array, hidden: Array, slope: Array) -> Array:
    """J'J of inputs x (n, q), hidden outputs (n, h) and their slopes v (1 - tanh^2) (n, h); above the diagonal stands
    anything.

    The block of units i and j is X'DX, with X the inputs and a column of ones and D the products of the units' slopes.
    It is symmetric, and so is the array of blocks: a quarter of all products is summed over the rows, in one matrix
    product.
    """
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
