"""Smooth coefficients of known designs, learned from many rows at once: y_i = design_i c(x_i) + noise.

c is a Gaussian process with a trend, in the span of some nodes (Quinonero-Candela, Rasmussen, J. Mach. Learn. Res. 6
(2005) 1939, section 4): each coefficient has an amplitude of its own, which the evidence gives (MacKay 1992), and all
share the lengths of the kernel. Single rows need not determine their coefficients.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from surrogate.statistics.gaussian_process import squared_exponential
from touchcal.arrays import Array

# Nodes of the coefficients, and those that amplitudes and noise are estimated with, in so many rounds.
NODES, FEW, ROUNDS = 300, 80, 4
TREND, JITTER = 10.0, 1e-8  # spread of the trend over the amplitude, and what is added to the kernel's diagonal
# Amplitude and relative noise to begin with, bins of the noise, and the least noise of a row.
AMPLITUDE, NOISE, BINS, LEAST = 0.3, 3e-3, 8, 1e-6


@dataclass(frozen=True)
class SharedProcess:
    """c(x) = [1, u, exp(-|u - node|^2 / 2)] weights, u = (x - centre) / lengths."""

    nodes: Array  # (k, q) in u
    # (q,) unit of each input
    centre: Array
    lengths: Array
    weights: Array  # (1 + q + k, coefficients)

    @cached_property
    def moments(self) -> Array:
        """(k, (1 + q) coefficients) weights of the kernel, then these times each input of the nodes."""
        weights = self.weights[len(self.weights) - len(self.nodes):]
        return np.hstack([weights, *(column[:, None] * weights for column in self.nodes.T)])


def fit(x: Array, design: Array, y: Array, lengths: Array, order: Array, most: int = NODES) -> SharedProcess:
    """Fit rows y (n, readings) with designs (n, readings, coefficients) at x (n, q); the noise of a row varies with its
    place along `order` (n,), and its readings share it, so that a row counts as one observation. most: nodes."""
    centre = x.mean(axis=0)
    u = (x - centre) / lengths
    gram = design.transpose(0, 2, 1) @ design
    right = (design.transpose(0, 2, 1) @ y[..., None])[..., 0]
    few = _regressors(u, _spread(u, FEW))
    amplitude, weight = np.full(design.shape[2], AMPLITUDE), np.full(len(x), 1 / NOISE**2)
    for _ in range(ROUNDS):
        mean, variance = _posterior(few, gram, right, weight, amplitude, with_variance=True)
        amplitude = np.sqrt(np.mean(mean**2 + variance, axis=0))
        left = y - (design @ (few @ mean)[..., None])[..., 0]
        weight = 1 / _smoothed(np.linalg.norm(left, axis=1), order) ** 2
    nodes = _spread(u, most)
    mean, _ = _posterior(_regressors(u, nodes), gram, right, weight, amplitude)
    inverse = solve_triangular(_factor(nodes), np.eye(len(nodes)), lower=True)
    return SharedProcess(nodes, centre, lengths, np.vstack([TREND * mean[:1 + x.shape[1]],
                                                             inverse.T @ mean[1 + x.shape[1]:]]))


def predict(process: SharedProcess, x: Array) -> tuple[Array, Array]:
    """Coefficients (n, c) and their derivatives (n, c, q) at x (n, q)."""
    u = (x - process.centre) / process.lengths
    n, q = u.shape
    trend = process.weights[:1 + q]
    along = (squared_exponential(u, process.nodes) @ process.moments).reshape(n, 1 + q, -1).transpose(0, 2, 1)
    gradient = trend[1:].T + along[..., 1:] - u[:, None] * along[..., :1]
    return trend[0] + u @ trend[1:] + along[..., 0], gradient / process.lengths


def _posterior(regressors: Array, gram: Array, right: Array, weight: Array, amplitude: Array,
               with_variance: bool = False) -> tuple[Array, Array]:
    """Mean (regressors, coefficients) of the weights, and their variance, or none."""
    q, k = regressors.shape[1], len(amplitude)
    normal = np.empty((k, q, k, q))
    for i in range(k):
        for j in range(i + 1):
            normal[i, :, j] = (regressors * (weight * gram[:, i, j])[:, None]).T @ regressors
            normal[j, :, i] = normal[i, :, j].T
    flat = normal.reshape(k * q, k * q)
    flat[np.diag_indices(k * q)] += np.repeat(amplitude**-2.0, q)
    factor = cholesky(flat, lower=True, overwrite_a=True, check_finite=False)
    mean = cho_solve((factor, True), (regressors.T @ (weight[:, None] * right)).T.ravel(), check_finite=False)
    variance = np.zeros(k * q)
    if with_variance:
        variance = np.sum(solve_triangular(factor, np.eye(k * q), lower=True, check_finite=False) ** 2, axis=0)
    return mean.reshape(k, q).T, variance.reshape(k, q).T


def _smoothed(error: Array, order: Array) -> Array:
    """(n,) RMS error in bins of equal count along `order`, linear between their middles."""
    bins = np.array_split(np.argsort(order), BINS)
    middle = [float(order[b].mean()) for b in bins]
    return np.maximum(np.interp(order, middle, [float(np.sqrt(np.mean(error[b] ** 2))) for b in bins]), LEAST)


def _spread(u: Array, most: int) -> Array:
    """Rows of u (n, q), each the farthest from those before."""
    chosen = [0]
    distance = np.sum((u - u[0]) ** 2, axis=1)
    while len(chosen) < min(most, len(u)) and distance.max() > 0:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.sum((u - u[chosen[-1]]) ** 2, axis=1))
    return u[chosen]


def _regressors(u: Array, nodes: Array) -> Array:
    """(n, 1 + q + k) trend and whitened kernel."""
    within = solve_triangular(_factor(nodes), squared_exponential(nodes, u), lower=True).T
    return np.column_stack([np.full(len(u), TREND), TREND * u, within])


def _factor(nodes: Array) -> Array:
    return cholesky(squared_exponential(nodes, nodes) + JITTER * np.eye(len(nodes)), lower=True)
