"""A cheap log likelihood of one frame: whitened residuals as a polynomial of the touch, where they were worked out.

chi^2 = |W (f(u) - signal)|^2 with W (f(u) - signal) = B' phi(u), phi all products of scaled unknowns up to a degree;
only the triangular factor of B is kept, so that a touch costs a product of small matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEGREE = 4
# Points wanted for each product, and how far beyond their range, over it, the polynomial is believed.
POINTS, MARGIN = 6, 0.1
# chi^2 over the least from which a point counts half in the fit.
HALF = 20.0


@dataclass(frozen=True, eq=False)
class Emulator:
    """chi^2 of touches u (n, 4) inside a box."""

    # (4,) middle of the points and half their range
    middle: Array
    half: Array
    # (k, k) triangular factor: chi^2 = |factor phi|^2
    factor: Array


def wanted(unknowns: int) -> int:
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


def _phi(scaled: Array) -> Array:
    """(n, k) products."""
    powers = np.stack([scaled**k for k in range(DEGREE + 1)], axis=-1)
    out = []
    for one in _products(scaled.shape[1]):
        value = np.ones(len(scaled))
        for axis in set(one):
            value = value * powers[:, axis, one.count(axis)]
        out.append(value)
    return np.stack(out, axis=1)
