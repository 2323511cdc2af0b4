"""Gaussian process of many smooth quantities at once, which share the lengths of one Matern kernel (nu = 5/2)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky
from scipy.optimize import minimize

from surrogate.statistics.gaussian_process import negative_log_likelihood, squared_distance
from touchcal.arrays import Array

MAX_SEARCH, MAX_QUANTITIES = 600, 8  # most rows and quantities that the lengths are searched on
# Bounds of the lengths over the spread of their input, of the noise over the amplitude, and the most iterations.
LENGTH_BOUNDS, NOISE_BOUNDS, ITERATIONS = (0.1, 10.0), (1e-3, 1.0), 25
BLOCK = 32  # places whose kernels are worked out together, to stay in the cache
ROUNDING = 1e-5  # spread of an input over its largest value, or over 1, that counts as rounding


@dataclass(frozen=True)
class Matern:
    """y(x) = k(x, nodes) weights, k = (1 + t + t^2/3) exp(-t), t = sqrt(5) |x/l - x'/l|."""

    nodes: Array  # (k, q) training inputs over the lengths
    lengths: Array  # (q,) lengths, unit of each input
    weights: Array  # (k, outputs)

    @cached_property
    def table(self) -> Array:
        """(q + 2, k) what makes 5 |x/l - node|^2 of inputs x/l, their square and 1, all from the first node."""
        nodes = (self.nodes - self.nodes[0]).T
        return 5 * np.vstack([-2 * nodes, np.ones(nodes.shape[1]), np.sum(nodes**2, axis=0)])

    @cached_property
    def moments(self) -> Array:
        """(k, (1 + q) outputs) weights, then these times each input of the nodes, from the first one."""
        return np.hstack([self.weights, *(column[:, None] * self.weights for column in (self.nodes - self.nodes[0]).T)])


def fit(x: Array, y: Array) -> Matern:
    """Fit y (n, outputs) on x (n, q) (Rasmussen and Williams 2006, ch. 2)."""
    lengths, ratio = hyperparameters(x, y)
    nodes = x / lengths
    factor = cholesky(_kernel(_root(nodes, nodes)) + ratio**2 * np.eye(len(x)), lower=True)
    return Matern(nodes, lengths, cho_solve((factor, True), y))


def log_evidence(x: Array, y: Array, noise: float) -> float:
    """Log likelihood of quantities y (n, outputs) at inputs x (n, q) over the lengths, amplitudes eliminated, but for a
    constant; the noise is over the amplitude."""
    factor = cholesky(_kernel(_root(x, x)) + noise**2 * np.eye(len(x)), lower=True)
    return -_cost(factor, y, cho_solve((factor, True), y))[0]


def predict(process: Matern, x: Array, moving: int | None = None) -> tuple[Array, Array]:
    """Mean (n, outputs) and its gradient (n, outputs, q) at x (n, q), or by so many of the first inputs."""
    x, count, outputs = x / process.lengths - process.nodes[0], moving or x.shape[1], process.weights.shape[1]
    both = np.column_stack([x, np.sum(x**2, axis=1), np.ones(len(x))])
    mean, along = np.empty((len(x), outputs)), np.empty((len(x), (1 + count) * outputs))
    places = np.empty((3, min(BLOCK, len(x)), len(process.nodes)))
    for begin in range(0, len(x), BLOCK):
        some = slice(begin, begin + BLOCK)
        root, decay, grown = places[:, :len(both[some])]
        np.matmul(both[some], process.table, out=root)
        np.sqrt(np.maximum(root, 0.0, out=root), out=root)
        np.exp(np.negative(root, out=decay), out=decay)
        np.add(root, 1, out=grown)
        grown *= decay
        np.matmul(grown, process.moments[:, :(1 + count) * outputs], out=along[some])
        root *= root
        root *= decay
        root /= 3
        root += grown  # (1 + root + root^2 / 3) exp(-root)
        np.matmul(root, process.weights, out=mean[some])
    along = -5 / 3 * along.reshape(len(x), 1 + count, outputs).transpose(0, 2, 1)
    return mean, (x[:, None, :count] * along[..., :1] - along[..., 1:]) / process.lengths[:count]


def _root(a: Array, b: Array) -> Array:
    """sqrt(5) |a - b|, from the first of b, so that inputs close to one another lose no digits."""
    a, b = a - b[0], b - b[0]
    return np.sqrt(5 * squared_distance(a, b))


def _kernel(root: Array) -> Array:
    return (1 + root + root**2 / 3) * np.exp(-root)


def hyperparameters(x: Array, y: Array) -> tuple[Array, float]:
    """Most likely lengths (q,), and noise over amplitude, by some of the rows and quantities."""
    rows = np.random.default_rng(0).permutation(len(x))[:MAX_SEARCH]
    x, y = x[rows], y[rows, :MAX_QUANTITIES]
    span = np.std(x, axis=0)
    span = np.where(span > ROUNDING * np.maximum(np.abs(x).max(axis=0), 1.0), span, 1.0)
    q = x.shape[1]
    bounds = [tuple(np.log(LENGTH_BOUNDS))] * q + [tuple(np.log(NOISE_BOUNDS))]
    start = np.r_[np.zeros(q), np.log(1e-2)]
    found = minimize(_likelihood_and_gradient, start, (x / span, y), jac=True, method="L-BFGS-B", bounds=bounds,
                     options={"maxiter": ITERATIONS})
    return span * np.exp(found.x[:q]), float(np.exp(found.x[q]))


def _likelihood_and_gradient(log: Array, x: Array, y: Array) -> tuple[float, Array]:
    """Cost of quantities y (n, outputs) at inputs x (n, q), and its gradient by the logarithms of lengths and noise."""
    lengths, ratio = np.exp(log[:-1]), np.exp(log[-1])
    n, quantities = y.shape
    root = _root(x / lengths, x / lengths)
    factor = cholesky(_kernel(root) + ratio**2 * np.eye(n), lower=True)
    inverse = cho_solve((factor, True), np.eye(n))
    weights = inverse @ y
    value, quadratic = _cost(factor, y, weights)
    outer = quantities * inverse - n * (weights / quadratic) @ weights.T
    slope = outer * (5 / 3) * (1 + root) * np.exp(-root)
    by_length = [0.5 * np.sum(slope * (x[:, j, None] - x[:, j]) ** 2) / lengths[j] ** 2 for j in range(len(lengths))]
    return value, np.array([*by_length, ratio**2 * np.trace(outer)])


def _cost(factor: Array, y: Array, weights: Array) -> tuple[float, Array]:
    """The negative log likelihood of quantities y (n, outputs), with C's factor and C^-1 y; and y'C^-1 y (outputs,)."""
    quadratic = np.maximum(np.sum(y * weights, axis=0), np.finfo(float).tiny)
    return negative_log_likelihood(factor, quadratic), quadratic
