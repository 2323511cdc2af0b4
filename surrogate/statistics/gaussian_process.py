"""Gaussian process regression of one smooth quantity on a few inputs, hyperparameters by their posterior mode."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

from touchcal.arrays import Array, Index

# Most rows that a process keeps, and most that its hyperparameters are searched on; spread evenly over the rows.
MAX_NODES = 800
MAX_SEARCH = 300
# Bounds of the standard deviation of the noise over that of the process; the lower one keeps the Cholesky factor sound.
NOISE_BOUNDS = (1e-5, 1e2)
# Lengths over the spread of their input: median and spread of log of the prior. What is learned here is smooth over the
# training rows; without a prior, an input of a few discrete values may be taken as so many unrelated ones.
LENGTH_MEDIAN, LENGTH_SPREAD = 2.0, 0.7
LENGTH_BOUNDS = (0.2, 100.0)


@dataclass(frozen=True)
class GaussianProcess:
    """y(x) = b0 + b.(x - centre) + f(x), f a zero-mean process of kernel a^2 exp(-|x/l - x'/l|^2 / 2)."""

    nodes: Array  # (k, q) training inputs minus the centre, over the lengths
    centre: Array  # (q,) mean training input
    lengths: Array  # (q,) lengths l, unit of each input
    amplitude: float  # standard deviation a of the process, unit of y
    noise: Array  # (k,) variance of the noise of each node, unit of y squared
    values: Array  # (k,) y at the nodes

    @cached_property
    def factor(self) -> Array:
        """(k, k) lower Cholesky factor of the covariance of the nodes."""
        kernel = squared_exponential(self.nodes, self.nodes)
        return cholesky(self.amplitude**2 * kernel + np.diag(self.noise), lower=True)

    @cached_property
    def carried(self) -> Array:
        """(k, q + 1) regressors of the trend at the nodes, whitened by the factor."""
        return solve_triangular(self.factor, _regressors(self.nodes * self.lengths), lower=True)

    @cached_property
    def trend(self) -> Array:
        """(q + 1,) b0, b by generalised least squares."""
        whitened = solve_triangular(self.factor, self.values, lower=True)
        return np.asarray(np.linalg.lstsq(self.carried, whitened, rcond=None)[0], np.float64)

    @cached_property
    def inverse(self) -> Array:
        """(k, k) inverse of the factor."""
        return solve_triangular(self.factor, np.eye(len(self.values)), lower=True)

    @cached_property
    def trend_covariance(self) -> Array:
        """(q + 1, q + 1) covariance of b0, b."""
        return np.asarray(np.linalg.pinv(self.carried.T @ self.carried, hermitian=True), np.float64)

    @cached_property
    def weights(self) -> Array:
        """(k,) inverse covariance times what the trend leaves of the values."""
        return cho_solve((self.factor, True), self.values - _regressors(self.nodes * self.lengths) @ self.trend)

    @cached_property
    def alone(self) -> Together:
        """This process as the only one."""
        return Together((self,))


def fit(x: Array, y: Array, variance: Array | None = None) -> GaussianProcess:
    """Fit y (n,) on x (n, q); `variance` (n,) is the noise variance up to one factor, which is fitted (Rasmussen and
    Williams 2006, ch. 2 and 5). ValueError where fewer rows than trend coefficients + 1 are given."""
    if len(x) < x.shape[1] + 2:
        raise ValueError(f"{len(x)} rows are too few to learn from {x.shape[1]} inputs; at least {x.shape[1] + 2}.")
    shape = np.ones(len(x)) if variance is None else variance / np.median(variance)
    kept = spread_evenly(len(x), MAX_NODES)
    centre = x[kept].mean(axis=0)
    x, y, shape = x[kept] - centre, y[kept], shape[kept]
    search = spread_evenly(len(x), MAX_SEARCH)
    regressors, root = _regressors(x[search]), np.sqrt(shape[search])
    trend = np.linalg.lstsq(regressors / root[:, None], y[search] / root, rcond=None)[0]
    lengths, amplitude, ratio = _hyperparameters(x[search], y[search] - regressors @ trend, shape[search])
    return GaussianProcess(x / lengths, centre, lengths, amplitude, (amplitude * ratio) ** 2 * shape, y)


def predict(process: GaussianProcess, x: Array) -> tuple[Array, Array, Array]:
    """Mean (n,), gradient of the mean (n, q) and variance (n,) of y without its noise at x (n, q).

    The variance includes the trend's, and leaves out that of the hyperparameters, which are taken as known.
    """
    value, gradient = means(process.alone, x)
    return value[:, 0], gradient[:, 0], variances(process.alone, x)[:, 0]


@dataclass(frozen=True, eq=False)
class Together:
    """Processes of the same inputs, whose kernels are worked out in one product."""

    processes: tuple[GaussianProcess, ...]

    @cached_property
    def scale(self) -> Array:
        """(processes, 1, q) reciprocal lengths."""
        return 1 / np.stack([one.lengths for one in self.processes])[:, None]

    @cached_property
    def table(self) -> Array:
        """(processes, q + 2, k) nodes, 1 and half their squares, whose products with inputs are exponents."""
        nodes = np.stack([one.nodes.T for one in self.processes])
        return np.concatenate([nodes, np.ones_like(nodes[:, :1]), -0.5 * np.sum(nodes**2, axis=1, keepdims=True)],
                              axis=1)

    @cached_property
    def moments(self) -> Array:
        """(processes, k, 1 + q) weights of the kernel, and these times the nodes."""
        weights = np.stack([one.amplitude**2 * one.weights for one in self.processes])[..., None]
        return np.concatenate([weights, weights * np.stack([one.nodes for one in self.processes])], axis=2)

    @cached_property
    def trend(self) -> Array:
        """(1 + q, processes) trends."""
        return np.stack([one.trend for one in self.processes], axis=1)

    @cached_property
    def amplitude(self) -> Array:
        """(processes, 1) amplitudes."""
        return np.array([[one.amplitude] for one in self.processes])

    @cached_property
    def inverse(self) -> Array:
        """(processes, k, k) transposed inverses of the factors, times the squared amplitudes."""
        return np.stack([one.amplitude**2 * one.inverse.T for one in self.processes])

    @cached_property
    def carried(self) -> Array:
        """(processes, k, q + 1) whitened regressors of the trends."""
        return np.stack([one.carried for one in self.processes])

    @cached_property
    def trend_covariance(self) -> Array:
        """(processes, q + 1, q + 1) covariances of the trends."""
        return np.stack([one.trend_covariance for one in self.processes])


def _kernels(together: Together, x: Array) -> tuple[Array, Array]:
    """Inputs (n, q) less the centre over the lengths (processes, n, q), and kernels (processes, n, k) over the squared
    amplitudes."""
    u = x * together.scale
    half = -0.5 * np.sum(u**2, axis=2, keepdims=True)
    exponent = np.concatenate([u, half, np.ones_like(half)], axis=2) @ together.table
    return u, np.exp(np.minimum(exponent, 0.0, out=exponent), out=exponent)


def means(together: Together, x: Array) -> tuple[Array, Array]:
    """Means (n, processes) and their gradients (n, processes, q) at x (n, q)."""
    x, slope = x - together.processes[0].centre, together.trend[1:]
    u, kernel = _kernels(together, x)
    found = kernel @ together.moments
    gradient = (found[..., 1:] - found[..., :1] * u) * together.scale
    return found[..., 0].T + together.trend[0] + x @ slope, gradient.transpose(1, 0, 2) + slope.T


def variances(together: Together, x: Array) -> Array:
    """(n, processes) variances of y without noise at x (n, q), as `predict`."""
    x = x - together.processes[0].centre
    half = _kernels(together, x)[1] @ together.inverse
    variance = np.maximum(together.amplitude**2 - np.einsum("pnk,pnk->pn", half, half), 0.0)
    unseen = _regressors(x) - half @ together.carried
    trend = np.sum((unseen @ together.trend_covariance) * unseen, axis=2)
    return (variance + np.maximum(trend, 0.0)).T


def spread_evenly(n: int, most: int) -> Index:
    """At most so many of n rows, spread evenly over them."""
    return np.linspace(0, n - 1, min(n, most)).round().astype(np.intp)


def squared_distance(a: Array, b: Array) -> Array:
    """(n, m) |a - b|^2 of inputs (n, q) and (m, q)."""
    found = (-2 * a) @ b.T
    found += np.sum(a**2, axis=1)[:, None]
    found += np.sum(b**2, axis=1)
    return np.maximum(found, 0.0, out=found)


def squared_exponential(a: Array, b: Array) -> Array:
    """(n, m) exp(-|a - b|^2 / 2) of inputs (n, q) and (m, q) over the lengths."""
    return np.exp(-0.5 * squared_distance(a, b))


def negative_log_likelihood(factor: Array, quadratic: Array) -> float:
    """Sum over quantities of n/2 log(y'C^-1 y) + log|C|/2, amplitudes eliminated, by the Cholesky factor (n, n) of C
    and y'C^-1 y (outputs,)."""
    return float(0.5 * len(factor) * np.log(quadratic).sum() + len(quadratic) * np.log(np.diag(factor)).sum())


def _regressors(x: Array) -> Array:
    return np.column_stack([np.ones(len(x)), x])


def _hyperparameters(x: Array, y: Array, shape: Array) -> tuple[Array, float, float]:
    """Most probable lengths, amplitude and noise ratio; the amplitude in closed form."""
    span = np.std(x, axis=0)
    span = np.where(span > 1e-12 * np.maximum(np.abs(x).max(axis=0), 1.0), span, 1.0)
    squared = (x[:, None, :] - x) ** 2 / span**2
    q = x.shape[1]
    bounds = [tuple(np.log(LENGTH_BOUNDS))] * q + [tuple(np.log(NOISE_BOUNDS))]
    starts = [np.r_[np.full(q, np.log(length)), np.log(noise)] for length, noise in ((2.0, 1e-2), (1.0, 0.3))]
    found = [minimize(_negative_log_posterior, start, (squared, y, shape), jac=True, method="L-BFGS-B", bounds=bounds)
             for start in starts]
    best = min(found, key=lambda result: result.fun).x
    lengths, ratio = np.exp(best[:q]), float(np.exp(best[q]))
    covariance = np.exp(-0.5 * squared @ lengths**-2.0) + ratio**2 * np.diag(shape)
    quadratic = float(y @ cho_solve((cholesky(covariance, lower=True), True), y))
    return span * lengths, max(np.sqrt(quadratic / len(y)), np.finfo(float).tiny**0.25), ratio


def _negative_log_posterior(log: Array, squared: Array, y: Array, shape: Array) -> tuple[float, Array]:
    value, gradient = _likelihood_and_gradient(log, squared, y, shape)
    off = (log[:-1] - np.log(LENGTH_MEDIAN)) / LENGTH_SPREAD
    return value + 0.5 * float(off @ off), gradient + np.r_[off / LENGTH_SPREAD, 0.0]


def _likelihood_and_gradient(log: Array, squared: Array, y: Array, shape: Array) -> tuple[float, Array]:
    """The negative log likelihood and its gradient by the logarithms of lengths and noise ratio."""
    lengths, ratio = np.exp(log[:-1]), np.exp(log[-1])
    smooth = np.exp(-0.5 * squared @ lengths**-2.0)
    factor = cholesky(smooth + ratio**2 * np.diag(shape), lower=True)
    inverse = cho_solve((factor, True), np.eye(len(y)))
    weights = inverse @ y
    quadratic = max(float(y @ weights), np.finfo(float).tiny)
    value = negative_log_likelihood(factor, np.array([quadratic]))
    outer = inverse - np.outer(weights, weights) * len(y) / quadratic
    by_length = 0.5 * np.einsum("ij,ijq->q", outer * smooth, squared) * lengths**-2.0
    by_noise = ratio**2 * np.sum(np.diag(outer) * shape)
    return value, np.r_[by_length, by_noise]
