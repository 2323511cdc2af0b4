"""Graded triangles in the plane: points of a quadtree between given ones, Delaunay's triangles, quadratic nodes."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from touchcal.arrays import Array

Indices = NDArray[np.int64]
Size = Callable[[Array], Array]

# Corners of a quadratic triangle's edges, whose middles follow its corners in this order.
EDGES = ((0, 1), (1, 2), (0, 2))

# Least distance of other points from given ones, in sizes, and how often they are moved to their neighbours' mean.
_CLOSEST, _SMOOTHINGS = 0.6, 4
# Area of a triangle over that of its circumscribed square that is rounding.
_FLAT = 1e-9


def filled(given: Array, size: Size, inside: Callable[[Array], NDArray[np.bool_]],
           box: tuple[Array, Array]) -> tuple[Array, Indices]:
    """Points (n, 2), the given ones first, and all Delaunay triangles (t, 3), counter-clockwise, of about a size, of
    points inside a box given by its least and largest coordinates."""
    low, high = box
    fill = _leaves((low + high) / 2, float((high - low).max()), size)
    fill = fill[inside(fill)]
    fill = fill[KDTree(given).query(fill)[0] > _CLOSEST * size(fill)] if len(fill) else fill
    for _ in range(_SMOOTHINGS if len(fill) else 0):
        points = np.vstack([given, fill])
        fill = _smoothed(points, _triangles(points))[len(given):]
    points = np.vstack([given, fill])
    return points, _triangles(points)


def _leaves(middle: Array, side: float, size: Size) -> Array:
    """Middles (n, 2) of the squares of a quadtree that are no larger than the size there."""
    found, squares = [], middle[None]
    while len(squares):
        large = side > size(squares)
        found.append(squares[~large])
        side /= 2
        squares = (squares[large, None] + side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])).reshape(-1, 2)
    return np.vstack(found)


def _triangles(points: Array) -> Indices:
    cells = Delaunay(points).simplices.astype(np.int64)
    a, b, c = np.moveaxis(points[cells], 1, 0)
    area = cross(b - a, c - a)
    span = np.ptp(points[cells], axis=1).max(axis=1)
    cells, area = cells[np.abs(area) > _FLAT * span**2], area[np.abs(area) > _FLAT * span**2]
    return np.where((area > 0)[:, None], cells, cells[:, [0, 2, 1]])


def _smoothed(points: Array, cells: Indices) -> Array:
    one, other = np.vstack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]).T
    count = np.bincount(one, minlength=len(points)) + np.bincount(other, minlength=len(points))
    total = [np.bincount(one, points[other, i], len(points)) + np.bincount(other, points[one, i], len(points))
             for i in (0, 1)]
    return np.column_stack(total) / np.maximum(count, 1)[:, None]


def cross(one: Array, other: Array) -> Array:
    """Cross products (...) of vectors (..., 2)."""
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def quadratic(corners: Array, cells: Indices) -> tuple[Array, Indices, Indices]:
    """Nodes (n, 2), corners first, cells (t, 6) with the middles of their edges, and the edges' ends (edges, 2), the
    lower number first, whose middles follow the corners in this order."""
    sides = np.sort(np.stack([cells[:, edge] for edge in EDGES], axis=1), axis=2)
    edges, number = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    return (np.vstack([corners, corners[edges].mean(axis=1)]),
            np.column_stack([cells, len(corners) + number.reshape(-1, 3)]), edges)
