"""Whether two touches explain a signal that one does not: the best pair of places of a grid, each with free strengths
of its first multipoles."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion.multipole_location import planes
from touchcal.arrays import Array, Index

PLACES = 150


@dataclass(frozen=True, eq=False)
class _Pairs:
    axes: Array  # (places, readings, orders) orthonormal axes of each place
    first: Index  # (pairs,) places of each pair
    second: Index
    across: Array  # (pairs, orders, orders) products of the axes of the second with those of the first
    inverse: Array  # (pairs, orders, orders) inverse of what is left of the second's products without the first


@lru_cache(maxsize=2)
def _pairs(forward: ForwardMap) -> _Pairs:
    axes = np.linalg.qr(planes(forward, PLACES)[1].transpose(1, 0, 2))[0]
    first, second = np.triu_indices(PLACES, 1)
    products = np.einsum("ird,jre->ijed", axes, axes, optimize=True)
    across = products[first, second]
    left = np.eye(axes.shape[2]) - across @ across.transpose(0, 2, 1)
    return _Pairs(axes, first, second, across, np.linalg.inv(left + 1e-6 * np.eye(axes.shape[2])))


def left_by_pair(forward: ForwardMap, signal: Array) -> float:
    """Squared norm, V^2, of what the best pair leaves of a signal (readings,), V."""
    found = _pairs(forward)
    match = np.einsum("prd,r->pd", found.axes, signal)
    further = match[found.second] - (found.across @ match[found.first][..., None])[..., 0]
    explained = np.sum(match[found.first] ** 2, axis=1) + np.einsum("pd,pde,pe->p", further, found.inverse, further)
    return float(signal @ signal - explained.max())
