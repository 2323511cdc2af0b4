"""Closed-form ridge regression on products of features up to the second degree."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surrogate.data.samples import Samples
from surrogate.learners.base import Estimate, Learner, Training, regression
from surrogate.learners.signal_features import Directions, carried, features, fit_directions
from touchcal.arrays import Array, Index

COMPONENTS = (4, 6, 8, 11, 15, 20, 27, 36)
PENALTIES = np.logspace(-8, 3, 34)


@dataclass(frozen=True, eq=False)
class Lines:
    """Some outputs as linear functions of the same centred products."""

    directions: Directions
    mean: Array  # (m,) mean of each product
    sd: Array  # (m,) its standard deviation
    axes: Array  # (r, m) principal axes of the products
    columns: NDArray[np.int64]  # (k,) which outputs these are
    coefficients: Array  # (k, m) coefficients
    offset: Array  # (k,) their offsets
    # (k,) variance of the coefficients before the rows were seen, and (k, r) what these took of it along each axis
    prior_variance: Array
    taken: Array
    noise: Array  # (k,) variance of the residual by leave-one-out


@dataclass(frozen=True)
class Ridge(Learner):
    """Every output on the products that suit it."""

    lines: tuple[Lines, ...]

    @classmethod
    def fit(cls, rows: Samples, training: Training) -> Ridge:
        """Fit each output by what suits it."""
        return fit(rows.signal_V, rows.targets(training.names))

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """Outputs of signals (n, readings) under white noise."""
        outputs = sum(len(one.columns) for one in self.lines)
        value, variance = np.empty((len(signal_V), outputs)), np.empty((len(signal_V), outputs))
        for one in self.lines:
            value[:, one.columns], variance[:, one.columns] = _predict(one, signal_V, noise_V)
        return regression(value, variance)

    def record(self, training: Training) -> dict[str, Any]:
        """Components and products of each output."""
        found = {training.names[int(column)]: {"components": len(one.directions.axes), "products": len(one.mean)}
                 for one in self.lines for column in one.columns}
        return {name: found[name] for name in training.names}


def fit(signal_V: Array, target: Array) -> Ridge:
    """Fit signals (n, readings) to targets (n, outputs); components and penalty by leave-one-out error, each output."""
    bases = [_basis(signal_V, k) for k in COMPONENTS if k < len(signal_V)]
    errors = np.array([[[_leave_one_out(basis, y, penalty) for penalty in PENALTIES] for basis in bases]
                       for y in target.T])
    which = errors.min(axis=2).argmin(axis=1)
    return Ridge(tuple(_lines(basis, target, np.flatnonzero(which == k), errors[:, k])
                       for k, basis in enumerate(bases) if np.any(which == k)))


@dataclass(frozen=True)
class _Basis:
    directions: Directions
    mean: Array
    sd: Array
    # thin singular value decomposition of the standardised products
    left: Array
    singular: Array
    right: Array


@lru_cache(maxsize=len(COMPONENTS))
def _pairs(count: int) -> tuple[Index, Index]:
    return np.triu_indices(count)


def _products(f: Array) -> Array:
    i, j = _pairs(f.shape[1])
    return np.column_stack([f, f[:, i] * f[:, j]])


def _slopes(lines: Lines, f: Array) -> Array:
    """(n, outputs, features) derivatives of the lines by the features f (n, features)."""
    q = f.shape[1]
    weight = lines.coefficients / lines.sd
    second = np.zeros((len(weight), q, q))
    second[:, *_pairs(q)] = weight[:, q:]
    both = (second + second.transpose(0, 2, 1)).transpose(1, 0, 2).reshape(q, -1)
    return weight[:, :q] + (f @ both).reshape(len(f), len(weight), q)


def _basis(signal_V: Array, components: int) -> _Basis:
    directions = fit_directions(signal_V, components)
    products = _products(features(directions, signal_V))
    mean, sd = products.mean(0), np.maximum(products.std(0), 1e-12)
    left, singular, right = np.linalg.svd((products - mean) / sd, full_matrices=False)
    return _Basis(directions, mean, sd, left, singular, right)


def _lines(basis: _Basis, target: Array, columns: Index, errors: Array) -> Lines:
    """Lines of the outputs of these columns; errors: (outputs, penalties) by leaving one out."""
    best = errors[columns].argmin(axis=1)
    noise, penalty = errors[columns, best], PENALTIES[best] * len(target)
    y = target[:, columns]
    kept = basis.singular**2 + penalty[:, None]
    coefficients = (basis.singular / kept * (basis.left.T @ (y - y.mean(0))).T) @ basis.right
    return Lines(basis.directions, basis.mean, basis.sd, basis.right, columns.astype(np.int64), coefficients, y.mean(0),
                 noise / penalty, noise[:, None] * (1 / penalty[:, None] - 1 / kept), noise)


def _leave_one_out(basis: _Basis, y: Array, penalty: float) -> float:
    weight = basis.singular**2 / (basis.singular**2 + penalty * len(y))
    centred = y - y.mean()
    fitted = basis.left @ (weight * (basis.left.T @ centred))
    leverage = np.minimum((basis.left**2) @ weight + 1 / len(y), 1 - 1e-9)
    return float(np.mean(((centred - fitted) / (1 - leverage)) ** 2))


def _predict(lines: Lines, signal_V: Array, noise_V: float) -> tuple[Array, Array]:
    """(n, k) values and variances."""
    f = features(lines.directions, signal_V)
    products = (_products(f) - lines.mean) / lines.sd
    along = products @ lines.axes.T
    left = np.sum(products**2, axis=1)[:, None] * lines.prior_variance - along**2 @ lines.taken.T
    variance = lines.noise + np.maximum(left, 0.0)
    if noise_V > 0:
        variance = variance + carried(lines.directions, signal_V, _slopes(lines, f), noise_V)
    return lines.offset + products @ lines.coefficients.T, variance
