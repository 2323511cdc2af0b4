"""Signed distance to a solid that triangles bound, as they are, sharp sides included."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from eitsim.scene.surfaces.triangle_surface import Indices, TriangleSurface, flat_nearest
from touchcal.arrays import Array

# Triangles looked at about a place, halvings of their sides at most, and squared distances over their sides' squares
# that are the same.
_NEAR, _HALVINGS, _SAME = 24, 12, 1e-12


@dataclass(frozen=True, eq=False)
class Solid:
    """What closed triangles bound, none of them with a longer side than a length."""

    surface: TriangleSurface
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
        told = np.argmax(np.where(nearest, np.abs(above), -1.0), axis=1)
        return -np.sign(above[np.arange(len(points)), told]) * np.sqrt(least)

    @cached_property
    def _corners(self) -> tuple[Array, KDTree]:
        nodes, cells = self.surface.nodes_m, self.surface.cells
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
