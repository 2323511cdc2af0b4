"""Quadratic triangles cut into four each, on the same curves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eitsim.cem import SkinMesh

Array = NDArray[np.float64]
Indices = NDArray[np.integer]

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


def halved(mesh: SkinMesh) -> SkinMesh:
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
    return replace(mesh, nodes_m=np.vstack([nodes, np.stack(on_edges, axis=1).reshape(-1, 2), inside.reshape(-1, 2)]),
                   cells=cells.reshape(-1, 6), under=under.reshape(-1, under.shape[2]), electrode=electrode)
