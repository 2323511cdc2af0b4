"""Closed-form ridge regression on products of features up to the second degree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate.estimate import Estimate
from surrogate.features import Directions, feature_slopes, features, learn_directions

Array = NDArray[np.float64]

COMPONENTS = (4, 6, 8, 11, 15, 20, 27, 36)
PENALTIES = np.logspace(-8, 3, 34)


@dataclass(frozen=True)
class Line:
    """One output as a linear function of the centred products."""

    directions: Directions
    # (m,) mean of each product, and its standard deviation
    mean: Array
    sd: Array
    # (m,) coefficients, and their offset
    coefficients: Array
    offset: float
    # (m, r) axes of the coefficients' covariance times their standard deviations, and the variance outside them
    axes: Array
    prior_variance: float
    # variance of the residual by leave-one-out
    noise: float


@dataclass(frozen=True)
class Ridge:
    """One line an output."""

    lines: tuple[Line, ...]


def learn(signal_V: Array, target: Array) -> Ridge:
    """Fit signals (n, readings) to targets (n, outputs); components and penalty by leave-one-out error, each output."""
    bases = [_basis(signal_V, k) for k in COMPONENTS if k < len(signal_V)]
    return Ridge(tuple(_line(bases, y) for y in target.T))


def estimate(ridge: Ridge, signal_V: Array, noise_V: float) -> Estimate:
    """Outputs of signals (n, readings) under white noise."""
    found = [_predict(line, signal_V, noise_V) for line in ridge.lines]
    return Estimate(np.column_stack([value for value, _ in found]), np.sqrt(np.column_stack([v for _, v in found])),
                    np.ones(len(signal_V)), np.ones(len(signal_V), bool))


@dataclass(frozen=True)
class _Basis:
    directions: Directions
    mean: Array
    sd: Array
    # thin singular value decomposition of the standardised products
    left: Array
    singular: Array
    right: Array


def _products(f: Array) -> Array:
    i, j = np.triu_indices(f.shape[1])
    return np.column_stack([f, f[:, i] * f[:, j]])


def _slope(line: Line, f: Array) -> Array:
    """(n, k + 1) derivative of the line by its features."""
    q = f.shape[1]
    i, j = np.triu_indices(q)
    weight = line.coefficients / line.sd
    second = np.zeros((q, q))
    np.add.at(second, (i, j), weight[q:])
    return weight[:q] + f @ (second + second.T)


def _basis(signal_V: Array, components: int) -> _Basis:
    directions = learn_directions(signal_V, components)
    products = _products(features(directions, signal_V))
    mean, sd = products.mean(0), np.maximum(products.std(0), 1e-12)
    left, singular, right = np.linalg.svd((products - mean) / sd, full_matrices=False)
    return _Basis(directions, mean, sd, left, singular, right)


def _line(bases: list[_Basis], y: Array) -> Line:
    errors = np.array([[_leave_one_out(basis, y, penalty) for penalty in PENALTIES] for basis in bases])
    which, penalty_index = np.unravel_index(np.argmin(errors), errors.shape)
    basis, penalty = bases[which], PENALTIES[penalty_index] * len(y)
    noise = float(errors[which, penalty_index])
    shrunk = basis.singular / (basis.singular**2 + penalty)
    coefficients = basis.right.T @ (shrunk * (basis.left.T @ (y - y.mean())))
    saved = 1 / penalty - 1 / (basis.singular**2 + penalty)
    return Line(basis.directions, basis.mean, basis.sd, coefficients, float(y.mean()),
                basis.right.T * np.sqrt(noise * saved), noise / penalty, noise)


def _leave_one_out(basis: _Basis, y: Array, penalty: float) -> float:
    """Mean squared leave-one-out error, by the leverages."""
    weight = basis.singular**2 / (basis.singular**2 + penalty * len(y))
    centred = y - y.mean()
    fitted = basis.left @ (weight * (basis.left.T @ centred))
    leverage = np.minimum((basis.left**2) @ weight + 1 / len(y), 1 - 1e-9)
    return float(np.mean(((centred - fitted) / (1 - leverage)) ** 2))


def _predict(line: Line, signal_V: Array, noise_V: float) -> tuple[Array, Array]:
    f = features(line.directions, signal_V)
    products = (_products(f) - line.mean) / line.sd
    value = line.offset + products @ line.coefficients
    explained = line.prior_variance * np.sum(products**2, axis=1) - np.sum((products @ line.axes) ** 2, axis=1)
    variance = line.noise + np.maximum(explained, 0.0)
    if noise_V > 0:
        by_signal = np.einsum("nq,nqk->nk", _slope(line, f), feature_slopes(line.directions, signal_V))
        variance = variance + noise_V**2 * np.sum(by_signal**2, axis=1)
    return value, variance
