"""A surface of triangles, made smooth: each is bent between the normals at its corners.

Phong tessellation: a place of a triangle is moved towards the mean of its projections onto the tangent planes at the
corners, weighted by its shares of them. It goes through the corners; a sphere of radius R is met to about h^4/R^3 by
triangles of side h, its normals to h^2/R^2. Source: Boubekeur, Alexa, ACM Trans. Graph. 27 (2008) 141,
doi:10.1145/1409060.1409094.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from eitsim.scene.surfaces.curved_surface import tangent_frame
from eitsim.scene.surfaces.projected_chart import ProjectedChart, form_at
from eitsim.scene.triangles.solid import dot, flat_nearest, open_nodes, outwards, solved_pair
from eitsim.scene.triangles.triangle_files import TriangleMesh
from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Share of the way to the tangent planes: at 1/2 a quadratic surface is met, since between two corners a chord stands as
# deep under the surface as that under the tangents.
_BENT = 0.5
# Triangles looked at about a place, those that are bent, and steps to the nearest place on one.
_NEAR, _TRIED, _STEPS = 12, 3, 6
# Step over which curvatures are found, in mean sides; the angle, rad, about their radius to which coordinates reach.
_STEP, _REACH = 2.0, 1.2


@dataclass(frozen=True, eq=False)
class TriangleSurface:
    """Triangles in space, their outward side where the corners turn counter-clockwise."""

    nodes_m: Array  # (n, 3)
    cells: Indices  # (t, 3)

    @cached_property
    def normals(self) -> Array:
        """Unit normals (n, 3) at the nodes, exact on a sphere: products of the sides there over their squares (Max, J.
        Graph. Tools 4 (1999) 1, doi:10.1080/10867651.1999.10487501)."""
        corners, out = self.nodes_m[self.cells], np.zeros_like(self.nodes_m)
        for k in range(3):
            one, other = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
            squares = np.sum(one**2, axis=1) * np.sum(other**2, axis=1)
            np.add.at(out, self.cells[:, k], np.cross(one, other) / squares[:, None])
        return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), np.finfo(float).tiny)

    @cached_property
    def side_m(self) -> float:
        """Mean length of the triangles' sides."""
        corners = self.nodes_m[self.cells]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    @cached_property
    def _middles(self) -> KDTree:
        return KDTree(self.nodes_m[self.cells].mean(axis=1))

    @cached_property
    def rim(self) -> Indices:
        """Nodes on open edges: none of a closed surface."""
        return open_nodes(self.cells)

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """As of `CurvedSurface`, on the bent triangles near each point."""
        _, near = self._middles.query(points, k=min(_NEAR, len(self.cells)))
        near = near.reshape(len(points), -1)
        corners = self.nodes_m[self.cells[near]]
        share, miss = flat_nearest(corners, points[:, None])
        best, k = np.argsort(miss, axis=1)[:, :_TRIED], np.arange(len(points))
        found = [self._bent(near[k, one], share[k, one], points) for one in best.T]
        at, normal = (np.stack(part) for part in zip(*found, strict=True))
        closest = np.argmin(np.linalg.norm(at - points, axis=2), axis=0)
        return at[closest, k], normal[closest, k]

    def _bent(self, cell: Indices, share: Array, points: Array) -> tuple[Array, Array]:
        """The places of bent triangles whose normals meet the points, from flat ones by their shares (n, 2)."""
        bend, normals = self._bends[cell], self.normals[self.cells[cell]]
        for _ in range(_STEPS):
            (at, one, other), normal = _phong(bend, share), _across(normals, share)
            off = points - at - dot(points - at, normal)[:, None] * normal
            share = _inside(share + solved_pair(one, other, off))
        return _phong(bend, share)[0], _across(normals, share)

    @cached_property
    def _bends(self) -> Array:
        """(t, 6, 3) a place of each triangle, quadratic in its shares: values of the three corners, then of products of
        the shares of corners 0 and 1, 0 and 2, 1 and 2."""
        corner, normal = self.nodes_m[self.cells], self.normals[self.cells]
        pairs = [_BENT * (dot(corner[:, b] - corner[:, a], normal[:, b])[:, None] * normal[:, b]
                          - dot(corner[:, b] - corner[:, a], normal[:, a])[:, None] * normal[:, a])
                 for a, b in ((0, 1), (0, 2), (1, 2))]
        return np.concatenate([corner, np.stack(pairs, axis=1)], axis=1)

    def chart_about(self, point: Array) -> ProjectedChart:
        """As of `CurvedSurface`; curvatures are means over a few triangles, and no coordinates reach an open edge."""
        (origin,), (normal,) = self.nearest(np.asarray(point, dtype=float)[None])
        frame = tangent_frame(normal)
        form = form_at(self, origin, frame, _STEP * self.side_m)
        size = float(np.ptp(self.nodes_m, axis=0).max())
        radius = min(1 / max(float(np.abs(np.linalg.eigvalsh(form)).max()), 1e-300), size)
        rim = self.nodes_m[self.rim]
        to_rim = np.linalg.norm(rim - origin, axis=1)
        limit = float(to_rim.min(initial=_REACH * radius))
        opened = rim[np.argmin(to_rim)] if limit < _REACH * radius else None
        return ProjectedChart(self, origin, frame, form, limit, radius, opened)


def triangle_surface(mesh: TriangleMesh) -> TriangleSurface:
    """The surface of a file's triangles, each part turned one way round: outwards where it is closed, else as
    most of the file's triangles turn."""
    used, cells = np.unique(mesh.cells[:, :3], return_inverse=True)
    nodes, cells = mesh.nodes_m[used], cells.reshape(-1, 3)
    return TriangleSurface(nodes, outwards(nodes, cells))


def _phong(bend: Array, share: Array) -> tuple[Array, Array, Array]:
    """Places (n, 3) of bent triangles (n, 6, 3) at shares (n, 2), and their derivatives by both shares."""
    a, b, c, ab, ac, bc = (bend[:, k] for k in range(6))
    v, w = share[:, :1], share[:, 1:]
    u = 1 - v - w
    return (u * a + v * b + w * c + u * v * ab + u * w * ac + v * w * bc,
            b - a + (u - v) * ab + w * (bc - ac), c - a + (u - w) * ac + v * (bc - ab))


def _across(normals: Array, share: Array) -> Array:
    """Unit normals (n, 3) of triangles at shares (n, 2), from those at their corners (n, 3, 3)."""
    v, w = share[:, :1], share[:, 1:]
    normal = (1 - v - w) * normals[:, 0] + v * normals[:, 1] + w * normals[:, 2]
    return normal / np.sqrt(dot(normal, normal))[:, None]


def _inside(share: Array) -> Array:
    """Shares (n, 2) moved into the triangle."""
    share = np.maximum(share, 0.0)
    return share / np.maximum(share.sum(axis=1, keepdims=True), 1.0)
