"""The process that gives patterns at places: u_i = a + g * e(p_i) + f(p_i) + noise, reading by reading.

e is what is expected of each reading at a place, known up to the gains g; f has a Matern-5/2 kernel in the plane, the
same for all readings up to a common factor. Gains are generalised least squares, shrunk a little; where nothing is
expected, e = 0.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from surrogate.recordings.patterns import centred
from surrogate.statistics import left_out
from surrogate.statistics.gaussian_process import spread_evenly, squared_distance
from touchcal.arrays import Array, Index

LENGTHS = (0.3, 0.45, 0.65, 1.0, 1.4, 2.0)  # lengths tried, over the spread of the places along an axis
NOISES = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)  # variances of noise tried, over that of the process
MOST_SEARCHED = 500  # rows that length and noise are chosen on
RIDGE = 0.05  # of the mean information on a gain: gains are believed to be no surer before any data


@dataclass(frozen=True, eq=False)
class Process:
    """What is fixed before the process is fitted."""

    length: float  # mm
    noise: float  # variance of the noise over that of the process


@dataclass(frozen=True, eq=False)
class Expected:
    """What is expected of patterns, up to a gain of each reading, as learnt from presses at some places."""

    at: Callable[[Array], Array]  # places (g, 2), mm -> patterns (g, m)
    left_out: Array | None = None  # (n, m) at the places it was learnt from, each as without its press; None: as `at`

    def of(self, place: Array) -> Array:
        """(n, m) at the places (n, 2), mm, that it was learnt from."""
        return self.at(place) if self.left_out is None else self.left_out


def matern(a: Array, b: Array, length: float) -> Array:
    """(n, k) Matern-5/2 kernel between places (n, 2) and (k, 2) of a length in their unit."""
    root = squared_distance(a, b)  # in place from here on: on a grid of many presses new arrays cost half of the time
    root *= 5
    np.sqrt(root, out=root)
    root /= length
    kernel, square = 1 + root, root**2
    square /= 3
    kernel += square
    np.negative(root, out=root)
    np.exp(root, out=root)
    kernel *= root
    return kernel


def choose(pattern: Array, place: Array, expected: Array, press: Index | None = None) -> Process:
    """Length and noise of the highest predictive density of patterns (n, m) at places (n, 2), mm, each without its
    press (n,), or itself alone where that is None, one amplitude for all readings; expected (n, m) there."""
    rows = spread_evenly(len(pattern), MOST_SEARCHED)
    left, basis, at = centred(pattern[rows]), centred(expected[rows]), place[rows]
    kept = None if press is None else press[rows]
    spread = float(np.sqrt(at.var(axis=0).mean()))
    scored = []
    for length in LENGTHS:
        values, axes = np.linalg.eigh(matern(at, at, length * spread))
        turned, turned_basis = axes.T @ left, axes.T @ basis
        for noise in NOISES:
            inverse = 1 / (np.maximum(values, 0) + noise)
            free = turned - _gains(turned, turned_basis, inverse[:, None] * turned_basis) * turned_basis
            missed, variance = left_out.missed(left_out.of_axes(axes, inverse), axes @ (inverse[:, None] * free), kept)
            common = np.mean(missed**2 / variance[:, None])
            scored.append((float(np.mean(np.log(common * variance))), length * spread, noise))
    return Process(*min(scored)[1:])


@dataclass(frozen=True, eq=False)
class Conditioned:
    """The process, given patterns at some places."""

    length: float  # mm
    place: Array  # (n, 2) mm
    weights: Array  # (n, m) of the kernels about the places
    gains: Array  # (m,)
    mean: Array  # (m,) of the patterns
    expected: Array  # (m,) mean of what is expected at the places
    residual: Array  # (n, m) of the patterns, each without its press

    def at(self, place: Array, expected: Array) -> Array:
        """Mean patterns (g, m) at places (g, 2), mm, where `expected` (g, m) is expected."""
        return (self.mean + self.gains * (expected - self.expected)
                + matern(place, self.place, self.length) @ self.weights)


def conditioned(process: Process, pattern: Array, place: Array, expected: Array,
                press: Index | None = None) -> Conditioned:
    """The process given patterns (n, m) of presses (n,), each its own where these are None, at places (n, 2), mm, where
    `expected` (n, m) is expected."""
    left, basis = centred(pattern), centred(expected)
    factor = cho_factor(matern(place, place, process.length) + process.noise * np.eye(len(place)))
    inverse = cho_solve(factor, np.eye(len(place)))
    gains = _gains(left, basis, inverse @ basis)
    weights = inverse @ (left - gains * basis)
    return Conditioned(process.length, place, weights, gains, pattern.mean(axis=0), expected.mean(axis=0),
                       left_out.missed(left_out.of_matrix(inverse), weights, press)[0])


def mapped(process: Process, pattern: Array, place: Array, expected: Array, grid: Array, expected_there: Array,
           press: Index | None = None) -> tuple[Array, Array]:
    """Mean patterns (g, m) on a grid (g, 2), mm, and residuals (n, m) of patterns (n, m) at places (n, 2), mm, each
    without its press (n,); expected (n, m) at the places and (g, m) on the grid."""
    found = conditioned(process, pattern, place, expected, press)
    return found.at(grid, expected_there), found.residual


def _gains(left: Array, basis: Array, weighted: Array) -> Array:
    """(m,) gains by generalised least squares; weighted: K^-1 times the basis (n, m)."""
    information = np.sum(basis * weighted, axis=0)
    return np.sum(left * weighted, axis=0) / np.maximum(information + RIDGE * information.mean(), np.finfo(float).tiny)
