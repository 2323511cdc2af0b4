"""Outer surfaces given by numbers as quadratic triangles, whose corners and middles lie on them."""

from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from eitsim.scene.surfaces.curved_surface import CurvedSurface
from eitsim.scene.triangles.triangle_files import Indices, TriangleMesh
from touchcal.arrays import Array

# Triangles around a cylinder, and times that those of an icosahedron are cut in four: quadratic ones are off by 4e-6 of
# the radius; triangles of a saddle along its side over the side's square over its lesser radius, and at least.
_AROUND, _TIMES, _ALONG, _LEAST = 32, 3, 24, 12
_SIDES = ((0, 1), (1, 2), (0, 2))


def cylinder_triangles(surface: CurvedSurface, radius_m: float, length_m: float) -> TriangleMesh:
    """The side of a cylinder about the x axis."""
    size = 2 * np.pi * radius_m / _AROUND
    along = np.linspace(-length_m / 2, length_m / 2, max(2, int(np.ceil(length_m / size)) + 1))
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    x, turn = (part.ravel() for part in np.meshgrid(along, angle, indexing="ij"))
    points = np.column_stack([x, radius_m * np.sin(turn), radius_m * np.cos(turn)])
    return quadratic(surface, points, _grid(len(along), _AROUND, closed=True), "cylinder")


def sphere_triangles(surface: CurvedSurface, radius_m: float) -> TriangleMesh:
    """A whole sphere."""
    golden = (1 + 5**0.5) / 2
    first = np.array([(a, b * golden) for a in (-1, 1) for b in (-1, 1)])
    nodes = np.vstack([np.insert(first, k, 0.0, axis=1) for k in range(3)])
    nodes[4:8] = nodes[4:8][:, ::-1]
    nodes = radius_m * nodes / np.linalg.norm(nodes[0])
    cells: Indices = ConvexHull(nodes).simplices.astype(np.int64)
    for _ in range(_TIMES):
        cut = quadratic(surface, nodes, cells, "sphere")
        nodes, (a, b, c, ab, bc, ac) = cut.nodes_m, cut.cells.T
        cells = np.vstack([np.column_stack(part) for part in ((a, ab, ac), (ab, b, bc), (ac, bc, c), (ab, bc, ac))])
    return quadratic(surface, nodes, cells, "sphere")


def saddle_triangles(surface: CurvedSurface, radius_m: float, length_m: float, width_m: float) -> TriangleMesh:
    """The part of a surface over a rectangle along x and y; radius: the lesser one of curvature, m."""
    size = radius_m / _ALONG * 2
    lines = [np.linspace(-side / 2, side / 2, max(_LEAST, int(np.ceil(side / size))) + 1)
             for side in (length_m, width_m)]
    x, y = (part.ravel() for part in np.meshgrid(*lines, indexing="ij"))
    points = np.column_stack([x, y, np.zeros_like(x)])
    return quadratic(surface, points, _grid(len(lines[0]), len(lines[1]), closed=False), "saddle")


def _grid(rows: int, columns: int, *, closed: bool) -> Indices:
    """Two triangles (2 n, 3) for each rectangle of a grid of nodes, closed or not from its last column to its first."""
    number = np.arange(rows * columns).reshape(rows, columns)
    number = np.column_stack([number, number[:, 0]]) if closed else number
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def quadratic(surface: CurvedSurface, points_m: Array, cells: Indices, name: str) -> TriangleMesh:
    """Triangles (t, 3) with the middles of their sides, all taken to the nearest places of the surface."""
    sides = np.sort(np.vstack([cells[:, list(side)] for side in _SIDES]), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    corners = surface.nearest(points_m)[0]
    middles = surface.nearest(corners[edges].mean(axis=1))[0]
    groups: dict[Any, Indices] = {}
    return TriangleMesh(name, np.vstack([corners, middles]),
                        np.column_stack([cells, len(corners) + number.reshape(len(_SIDES), -1).T]), groups)
