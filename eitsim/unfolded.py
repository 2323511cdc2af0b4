"""Curved P2 triangles that do not fold over, in a mesh or in what it is halved into."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature

from eitsim.cem import SkinMesh
from eitsim.halving import EDGES
from matcal.errors import NotConverged

Array = NDArray[np.float64]

# How often meshes are halved at most, and the degree of exactness of the stiffness's quadrature on each part.
HALVINGS, _DEGREE = 2, 4


def unfolded(mesh: SkinMesh, plain_m: Array) -> SkinMesh:
    """The P2 mesh with the nodes (n, 2) of `plain_m`, m, in the triangles that fold over and, again, in those that fold
    over then, until none is left.

    A triangle is folded where its Jacobian has another sign than that of its corners at a point of the quadrature, in
    it or in one of the parts of HALVINGS halvings. NotConverged where it folds over with the plain nodes too.
    """
    nodes = mesh.nodes_m.copy()
    while True:
        cells = mesh.cells[_folded(nodes[mesh.cells])]
        if not len(cells):
            return replace(mesh, nodes_m=nodes)
        if np.array_equal(nodes[cells], plain_m[cells]):
            raise NotConverged("no mesh of the skin was found whose elements are not flat or folded over; move the "
                               "punch further from the rim or from its neighbour.")
        nodes[cells] = plain_m[cells]


def straight(mesh: SkinMesh) -> Array:
    """Nodes (n, 2), m, of the P2 mesh with all edges straight and their middle nodes halfway."""
    nodes = mesh.nodes_m.copy()
    for a, b, middle in EDGES:
        nodes[mesh.cells[:, middle]] = (nodes[mesh.cells[:, a]] + nodes[mesh.cells[:, b]]) / 2
    return nodes


def _folded(nodes: Array) -> NDArray[np.bool_]:
    """Which of the triangles (n, 6, 2) are folded over.

    The Jacobian is a quadratic, told by its values at the nodes, and no less than the least of its Bezier coefficients.
    """
    xr, xs, yr, ys = (nodes[..., i] @ slope for i in (0, 1) for slope in _slopes())
    side = nodes[:, 1:3] - nodes[:, :1]
    turn = side[:, 0, 0] * side[:, 1, 1] - side[:, 1, 0] * side[:, 0, 1]
    jacobian = (xr * ys - xs * yr) * np.sign(turn)[:, None]
    ends = np.stack([jacobian[:, a] + jacobian[:, b] for a, b, _ in EDGES], axis=1)
    coefficients = np.hstack([jacobian[:, :3], 2 * jacobian[:, 3:] - ends / 2])
    doubtful = np.flatnonzero(~np.all(coefficients > 0, axis=1))
    folded = np.zeros(len(nodes), dtype=bool)
    folded[doubtful] = ~np.all(jacobian[doubtful] @ _functions() > 0, axis=1)
    return folded


@lru_cache(maxsize=1)
def _slopes() -> tuple[Array, Array]:
    """Derivatives (6, 6) of the functions along both reference coordinates at the nodes."""
    points = ElementTriP2().doflocs.T
    slopes = np.stack([np.broadcast_to(ElementTriP2().lbasis(points, i)[1], points.shape) for i in range(6)])
    return slopes[:, 0], slopes[:, 1]


@lru_cache(maxsize=1)
def _functions() -> Array:
    """The functions (6, points) at the points of the quadrature of a triangle and of the parts it is halved into."""
    points = get_quadrature(ElementTriP2(), _DEGREE)[0]
    found = [points]
    for _ in range(HALVINGS):
        points = np.hstack([points / 2, points / 2 + [[0.5], [0.0]], points / 2 + [[0.0], [0.5]], (1 - points) / 2])
        found.append(points)
    points = np.hstack(found)
    return np.stack([ElementTriP2().lbasis(points, i)[0] for i in range(6)])
