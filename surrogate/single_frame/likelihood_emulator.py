"""A cheap log likelihood of one frame: whitened residuals as a polynomial of the touch, where they were worked out.

chi^2 = |W (f(u) - signal)|^2 with W (f(u) - signal) = B' phi(u), phi all products of scaled unknowns up to a degree;
only the triangular factor of B is kept, so that a touch costs a product of small matrices.
"""

from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement

import numpy as np

from touchcal.arrays import Array, Index

DEGREE = 4
POINTS, MARGIN = 6, 0.1  # points for each product, and how far outside their range, over it, the polynomial is believed
HALF = 20.0  # chi^2 over the least from which a point counts half in the fit


@dataclass(frozen=True, eq=False)
class Emulator:
    """chi^2 of touches u (n, q) inside a box."""

    middle: Array  # (q,) middle of the points
    half: Array  # (q,) half their range
    factor: Array  # (rows, k) triangular factor: chi^2 = |factor phi|^2


def requested(unknowns: int) -> int:
    """Points that a fit needs."""
    return POINTS * len(_products(unknowns))


def fit(unknown: Array, residual: Array) -> Emulator:
    """From points (n, 4) and whitened residuals (n, readings) there."""
    low, high = unknown.min(axis=0), unknown.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    chi2 = np.sum(residual**2, axis=1)
    weight = 1 / np.sqrt(1 + (chi2 - chi2.min()) / HALF)
    phi = _phi((unknown - middle) / half)
    found = np.linalg.lstsq(phi * weight[:, None], residual * weight[:, None], rcond=1e-12)[0]
    return Emulator(middle, half, np.asarray(np.linalg.qr(found.T, mode="r"), np.float64))


def chi_squared(emulator: Emulator, unknown: Array) -> Array:
    """(n,) at touches (n, 4); infinite outside the box and its margin."""
    scaled = (unknown - emulator.middle) / emulator.half
    inside = np.all(np.abs(scaled) <= 1 + 2 * MARGIN, axis=1)
    out = np.full(len(unknown), np.inf)
    out[inside] = np.sum((_phi(scaled[inside]) @ emulator.factor.T) ** 2, axis=1)
    return out


def _products(unknowns: int) -> list[tuple[int, ...]]:
    return [one for degree in range(DEGREE + 1) for one in combinations_with_replacement(range(unknowns), degree)]


@cache
def _grown(unknowns: int) -> list[tuple[Index, Index]]:
    """For each degree from 1 on: the place of the product of one degree less, and the unknown it is taken times."""
    every = _products(unknowns)
    place = {one: k for k, one in enumerate(every)}
    of_degree = [[one for one in every if len(one) == degree] for degree in range(1, DEGREE + 1)]
    return [(np.array([place[one[:-1]] for one in part]), np.array([one[-1] for one in part])) for part in of_degree]


def _phi(scaled: Array) -> Array:
    """(n, k) products."""
    out = np.ones((len(scaled), 1))
    for fewer, times in _grown(scaled.shape[1]):
        out = np.hstack([out, out[:, fewer] * scaled[:, times]])
    return out
