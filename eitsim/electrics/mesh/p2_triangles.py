"""Curved P2 triangles that do not fold over, in a mesh or in what it is halved into."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from touchcal.errors import NotConverged

# How often meshes are halved at most, and the degree of exactness of the stiffness's quadrature on each part.
HALVINGS, _DEGREE = 2, 4

# Corners and middle node of each edge of a triangle, in the order of its nodes.
EDGES = ((0, 1, 3), (1, 2, 4), (0, 2, 5))
# Nodes of the four parts: 0 to 5 are the triangle's own, 6 to 11 lie halfway between a corner and a middle node, in the
# order of `_HALVES`, 12 to 14 between the middle nodes 3 and 4, 4 and 5, 3 and 5.
_PARTS = ((0, 3, 5, 6, 14, 11), (3, 1, 4, 7, 8, 12), (5, 4, 2, 13, 9, 10), (3, 4, 5, 12, 13, 14))
_HALVES = ((0, 3), (1, 3), (1, 4), (2, 4), (2, 5), (0, 5))
# The functions of the six nodes at the new nodes: towards a corner on an edge with its other end, and inside.
_ON_EDGE = np.array([0.375, -0.125, 0.75])
_INSIDE = np.array([[-0.125, 0.0, -0.125, 0.5, 0.5, 0.25], [-0.125, -0.125, 0.0, 0.25, 0.5, 0.5],
                    [0.0, -0.125, -0.125, 0.5, 0.25, 0.5]])
_QUARTER = 0.25  # Part of the way along an edge that starts at the end of an electrode at which its middle node lies.
_ON_RIM = 1e-9  # A node on the rim is nearer to it than this, over its radius.


def sides(cells: Indices) -> Indices:
    """Sides (3 cells, 2) of triangles, lower number first: those from corner 0 to 1, then 1 to 2, then 0 to 2."""
    one, other = cells.T[[0, 1, 0]].ravel(), cells.T[[1, 2, 2]].ravel()
    return np.column_stack([np.minimum(one, other), np.maximum(one, other)])


def untangled(mesh: SkinMesh, plain_m: Array) -> SkinMesh:
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

    The Jacobian is a quadratic, given by its nodal values, and no less than the least of its Bezier coefficients.
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


def uniform_refinement(mesh: SkinMesh) -> SkinMesh:
    """The mesh with every P2 triangle cut into four: it covers the same curved cells, and its potentials hold those of
    the mesh it is made from. ValueError for other elements."""
    if mesh.element != "P2":
        raise ValueError(f"only P2 meshes are halved, got element '{mesh.element}'.")
    count, nodes = len(mesh.nodes_m), mesh.nodes_m
    start = np.full(count, -1)
    stop = np.full(count, -1)
    for a, b, middle in EDGES:
        start[mesh.cells[:, middle]] = np.minimum(mesh.cells[:, a], mesh.cells[:, b])
        stop[mesh.cells[:, middle]] = np.maximum(mesh.cells[:, a], mesh.cells[:, b])
    middles = np.flatnonzero(start >= 0)
    rank = np.zeros(count, dtype=int)
    rank[middles] = np.arange(len(middles))

    def half(corner: Indices, middle: Indices) -> Indices:
        return count + 2 * rank[middle] + (corner != start[middle])

    ends = np.stack([start[middles], stop[middles]], axis=1)
    on_edges = [np.tensordot(_ON_EDGE, nodes[np.stack([one, other, middles])], 1)
                for one, other in ((ends[:, 0], ends[:, 1]), (ends[:, 1], ends[:, 0]))]
    inside = np.einsum("pk,ekx->epx", _INSIDE, nodes[mesh.cells])
    first = count + 2 * len(middles)
    number = first + np.arange(3 * len(mesh.cells)).reshape(-1, 3)
    all_nodes = np.column_stack([mesh.cells, *(half(mesh.cells[:, a], mesh.cells[:, b]) for a, b in _HALVES), number])
    cells = all_nodes[:, _PARTS]
    if mesh.under.shape[1] == 6:
        key = mesh.cells[:, 3] * count + mesh.cells[:, 4]
        order = np.argsort(key)
        at = order[np.searchsorted(key[order], mesh.under[:, 3] * count + mesh.under[:, 4])]
        under = cells[at]
    else:
        a, b, m = mesh.under.T
        under = np.stack([np.column_stack([a, m, half(a, m)]), np.column_stack([m, b, half(b, m)])], axis=1)
    electrode = np.repeat(mesh.electrode, under.shape[1])
    new = [part.reshape(-1, nodes.shape[1]) for part in (np.stack(on_edges, axis=1), inside)]
    return replace(mesh, nodes_m=np.vstack([nodes, *new]),
                   cells=cells.reshape(-1, 6), under=under.reshape(-1, under.shape[2]), electrode=electrode)


def with_quarter_points(mesh: SkinMesh) -> SkinMesh:
    """The P2 mesh of a disc, or of an outline with straight sides, with middle nodes moved to a quarter of the way from
    the ends of line electrodes, those two that touch have in common too, but where a triangle would fold over.

    Polynomials of an element are then polynomials of the root of the distance from there, and when it is halved the
    parts are graded towards it. Potentials behave so further from the end than z S; nodes on the rim stay there, whose
    curve the elements then follow to third order. The Jacobian is 0 at these ends themselves. Meshes with patches are
    given back as they are. Source: Barsoum, doi:10.1002/nme.1620100103.
    """
    if mesh.under.shape[1] != 3:
        return mesh
    owned = np.column_stack([mesh.under[:, :2].ravel(), np.repeat(mesh.electrode, 2)])
    corner, times = np.unique(owned, axis=0, return_counts=True)
    end = np.zeros(len(mesh.nodes_m), dtype=bool)
    end[corner[times == 1, 0]] = True
    place = mesh.nodes_m @ np.array([1, 1j])
    radius = abs(place[mesh.under[0, 0]])
    rim = np.abs(np.abs(place) - radius) < _ON_RIM * radius
    moved = place.copy()
    for i, j, middle in EDGES:
        for one, other in ((i, j), (j, i)):
            a, b, m = mesh.cells[end[mesh.cells[:, one]] & ~end[mesh.cells[:, other]]][:, [one, other, middle]].T
            along = place[a] * np.exp(1j * _QUARTER * np.angle(place[b] / place[a]))
            straight = (1 - _QUARTER) * place[a] + _QUARTER * place[b]
            moved[m] = np.where(rim[a] & rim[b] & rim[m], along, straight)
    return untangled(replace(mesh, nodes_m=np.column_stack([moved.real, moved.imag])), mesh.nodes_m)
