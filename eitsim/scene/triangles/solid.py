"""Signed distance to a solid that triangles bound, as they are, sharp sides included."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import KDTree

from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Triangles looked at about a place, halvings of their sides at most, and squared distances over their sides' squares
# that are the same.
_NEAR, _HALVINGS, _SAME = 24, 12, 1e-12
# Squared sine of the angle below which two sides are parallel but for rounding.
_PARALLEL = 1e-15


@dataclass(frozen=True, eq=False)
class Solid:
    """What closed triangles bound, none of them with a longer side than a length."""

    nodes_m: Array  # (n, 3)
    cells: Indices  # (t, 3), their outward side where the corners turn counter-clockwise
    longest_m: float

    def distance(self, points: Array) -> Array:
        """Depth (n,) inside of points (n, 3), negative outside. Of the nearest triangles, which share a side or a
        corner where there are several, the one that a point lies farthest above or below tells its sign."""
        corners, middles = self._corners
        near = middles.query(points, k=min(_NEAR, len(corners)))[1].reshape(len(points), -1)
        square = flat_nearest(corners[near], points[:, None])[1]
        one, other = (corners[near][:, :, k] - corners[near][:, :, 0] for k in (1, 2))
        normal = np.cross(one, other)
        above = np.sum((points[:, None] - corners[near][:, :, 0]) * normal, axis=2) / np.linalg.norm(normal, axis=2)
        least = square.min(axis=1)
        nearest = square <= least[:, None] + _SAME * self.longest_m**2
        tells = np.argmax(np.where(nearest, np.abs(above), -1.0), axis=1)
        return -np.sign(above[np.arange(len(points)), tells]) * np.sqrt(least)

    @cached_property
    def _corners(self) -> tuple[Array, KDTree]:
        nodes, cells = self.nodes_m, self.cells
        for _ in range(_HALVINGS):
            nodes, cells, done = _halved(nodes, cells, self.longest_m)
            if done:
                break
        return nodes[cells], KDTree(nodes[cells].mean(axis=1))


def _halved(nodes: Array, cells: Indices, longest_m: float) -> tuple[Array, Indices, bool]:
    """Triangles with their longest side halved where that is too long; whether none was."""
    corners = nodes[cells]
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1), axis=2)  # opposite to corners
    long, first = length.max(axis=1) > longest_m, np.argmax(length, axis=1)
    a, b, c = (np.take_along_axis(cells, (first[:, None] + k) % 3, axis=1)[long, 0] for k in range(3))
    middle = len(nodes) + np.arange(len(a))
    cells = np.concatenate([cells[~long], np.column_stack([a, b, middle]), np.column_stack([a, middle, c])])
    return np.vstack([nodes, (nodes[b] + nodes[c]) / 2]), cells, not long.any()


def outwards(nodes: Array, cells: Indices) -> Indices:
    """Triangles of which neighbours run their common side in opposite directions, part by part: a closed part with a
    positive volume, an open one, which has no inside, as most of its area turns already."""
    one, other = cells.T.ravel(), cells[:, [1, 2, 0]].T.ravel()
    side = np.minimum(one, other) * len(nodes) + np.maximum(one, other)
    order = np.argsort(side, kind="stable")
    pair = np.flatnonzero(side[order][1:] == side[order][:-1])
    first, second = order[pair], order[pair + 1]
    left, right, twisted = first % len(cells), second % len(cells), (one[first] == one[second]).astype(float)
    graph = coo_matrix((1 + twisted, (left, right)), shape=(len(cells),) * 2).tocsr()
    graph = graph + graph.T
    odd = np.zeros(len(cells), dtype=bool)
    count, part = connected_components(graph, directed=False)
    for k in range(count):
        way, before = breadth_first_order(graph, int(np.argmax(part == k)), directed=False)
        for cell in way[1:]:
            odd[cell] = odd[before[cell]] ^ (graph[before[cell], cell] > 1.5)
    cells = np.where(odd[:, None], cells[:, ::-1], cells)
    a, b, c = np.moveaxis(nodes[cells] - nodes.mean(axis=0), 1, 0)
    volume = np.bincount(part, np.sum(a * np.cross(b, c), axis=1), count)
    given = np.bincount(part, np.where(odd, -1, 1) * np.linalg.norm(np.cross(b - a, c - a), axis=1), count)
    _, which, times = np.unique(side, return_inverse=True, return_counts=True)
    lone = (times[which] == 1).reshape(3, -1).any(axis=0)
    is_open = np.bincount(part, lone, count) > 0
    return np.where((np.where(is_open, given, volume) < 0)[part][:, None], cells[:, ::-1], cells)


def open_nodes(cells: Indices) -> Indices:
    """Nodes on sides that one triangle alone has: none of a closed surface."""
    edges = np.sort(np.vstack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1)
    pairs, times = np.unique(edges, axis=0, return_counts=True)
    return np.unique(pairs[times == 1])


def dot(one: Array, other: Array) -> Array:
    """Products (...) of vectors (..., 3), term by term, which is faster than a sum over so short an axis."""
    return one[..., 0] * other[..., 0] + one[..., 1] * other[..., 1] + one[..., 2] * other[..., 2]


def solved_pair(one: Array, other: Array, off: Array) -> Array:
    """Parts (..., 2) of vectors (..., 3) along two others, by least squares; finite where these are nearly parallel."""
    aa, ab, bb, a, b = dot(one, one), dot(one, other), dot(other, other), dot(one, off), dot(other, off)
    square = np.maximum(aa * bb - ab * ab, _PARALLEL * aa * bb)
    return np.stack([bb * a - ab * b, aa * b - ab * a], axis=-1) / square[..., None]


def flat_nearest(corners: Array, points: Array) -> tuple[Array, Array]:
    """Shares (..., 2) and squared distances (...) of the nearest places of triangles (..., 3, 3) to points."""
    origin = corners[..., 0, :]
    one, other, off = corners[..., 1, :] - origin, corners[..., 2, :] - origin, points - origin
    best = solved_pair(one, other, off)
    within = (best.min(axis=-1) >= 0) & (best.sum(axis=-1) <= 1)
    miss = off - best[..., :1] * one - best[..., 1:] * other
    least = np.where(within, dot(miss, miss), np.inf)
    for start, way, begun, step in ((0.0, one, (0, 0), (1, 0)), (0.0, other, (0, 0), (0, 1)),
                                    (one, other - one, (1, 0), (-1, 1))):
        along = np.clip(dot(off - start, way) / dot(way, way), 0, 1)
        missed = off - start - along[..., None] * way
        far = dot(missed, missed)
        closer = far < least
        best = np.where(closer[..., None], np.array(begun) + along[..., None] * np.array(step), best)
        least = np.minimum(far, least)
    return best, least
