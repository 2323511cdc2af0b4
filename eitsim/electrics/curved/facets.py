"""A sheet in space as quadratic triangles, and the same sheet in smaller ones: new nodes lie on the triangles given.

Triangles are cut at points of their edges, which neighbours share. Where more of them ask for it, edges are halved, the
longest of a triangle first, so that no angle becomes small. Source: Rivara, doi:10.1002/nme.1620200412.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import Array, Indices
from eitsim.electrics.mesh.p2_triangles import EDGES, sides

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles in space."""

    nodes_m: Array  # (n, 3) nodes, m
    cells: Indices  # (t, 6) corners of each triangle, then the middles of its edges, in the order of EDGES
    electrode: Indices  # (t,) the electrode that each lies under, from 0; -1 under none
    factor: Array  # (t,) factor of its conductance when touched
    parent: Indices  # (t,) the triangle of the file that each is part of

    @property
    def corners_m(self) -> Array:
        """Corners (t, 3, 3), m."""
        return self.nodes_m[self.cells[:, :3]]

    @property
    def edges(self) -> tuple[Indices, Indices]:
        """Corners (edges, 2) of all edges, the lower number first, and the edges (t, 3) of each triangle."""
        first, number, ends = _edges(self.cells[:, :3])
        return ends[first], number.reshape(len(EDGES), -1).T

    def lengths_m(self, of_triangle: Indices) -> Array:
        """Lengths (edges,), m, of the chords of all edges, from `edges`."""
        corners = self.corners_m
        out = np.empty(of_triangle.max() + 1)
        for k, (a, b, _) in enumerate(EDGES):
            out[of_triangle[:, k]] = np.linalg.norm(corners[:, a] - corners[:, b], axis=1)
        return out


def _edges(corners: Indices) -> tuple[Indices, Indices, Indices]:
    """Of the sides (3 t, 2) of triangles (t, 3): the first of each edge, the edge of each, and the sides themselves."""
    ends = sides(corners)
    _, first, number = np.unique(ends @ np.array([corners.max() + 1, 1]), return_index=True, return_inverse=True)
    return first, number, ends


def functions(at: Array) -> Array:
    """Quadratic functions (..., 6) of the corners and middles at points (..., 2) of the reference triangle."""
    x, y = at[..., 0], at[..., 1]
    z = 1 - x - y
    return np.stack([z * (2 * z - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * x * z, 4 * x * y, 4 * y * z], axis=-1)


def slopes(at: Array) -> Array:
    """Derivatives (..., 6, 2) of `functions` along both axes of the reference triangle at points (..., 2)."""
    x, y = at[..., 0], at[..., 1]
    z, none = 1 - x - y, np.zeros_like(x)
    by_x = np.stack([1 - 4 * z, 4 * x - 1, none, 4 * (z - x), 4 * y, -4 * y], axis=-1)
    by_y = np.stack([1 - 4 * z, none, 4 * y - 1, -4 * x, 4 * x, 4 * (z - y)], axis=-1)
    return np.stack([by_x, by_y], axis=-1)


def split(facets: Facets, cut: NDArray[np.bool_], share: Array) -> Facets:
    """The triangles cut at points of edges: which of all edges (edges,), and how far along from their lower end."""
    ends, own = facets.edges
    number = np.where(cut, len(facets.nodes_m) + np.cumsum(cut) - 1, -1)
    corners, local, parent = [], [], []
    which = cut[own]
    for pattern in range(1 << len(EDGES)):
        t = np.flatnonzero(which @ (1 << np.arange(len(EDGES))) == pattern)
        if not len(t):
            continue
        at, name = np.empty((len(t), 6, 2)), np.empty((len(t), 6), dtype=np.int64)
        at[:, :3], name[:, :3] = CORNERS, facets.cells[t, :3]
        for k, (a, b, _) in enumerate(EDGES):
            from_lower = share[own[t, k]]
            along = np.where(facets.cells[t, a] == ends[own[t, k], 0], from_lower, 1 - from_lower)
            at[:, 3 + k] = (1 - along)[:, None] * CORNERS[a] + along[:, None] * CORNERS[b]
            name[:, 3 + k] = number[own[t, k]]
        for rows, pieces in _pieces(pattern, facets.corners_m[t], at):
            for piece in pieces:
                corners.append(name[rows][:, piece])
                local.append(at[rows][:, piece])
                parent.append(t[rows])
    inherited = np.concatenate(parent)
    return _joined(facets, np.vstack(corners), np.concatenate(local), inherited)


def _pieces(pattern: int, corners: Array, at: Array) -> list[tuple[Indices, tuple[tuple[int, int, int], ...]]]:
    """Rows of triangles, and the pieces that these are cut into: numbers 0 to 2 are corners, 3 to 5 points on EDGES."""
    rows = np.arange(len(corners))
    cut = [k for k in range(len(EDGES)) if pattern >> k & 1]
    if not cut:
        return [(rows, ((0, 1, 2),))]
    if len(cut) == len(EDGES):
        return [(rows, ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)))]
    if len(cut) == 1:
        a, b = EDGES[cut[0]][:2]
        c = 3 - a - b
        if (b - a) % 3 != 1:
            a, b = b, a
        point = 3 + cut[0]
        return [(rows, ((a, point, c), (point, b, c)))]
    (left,) = {0, 1, 2} - set(cut)
    a = 3 - EDGES[left][0] - EDGES[left][1]  # the corner between both cut edges
    b, c = (a + 1) % 3, (a + 2) % 3
    on_b, on_c = (3 + next(k for k in cut if set(EDGES[k][:2]) == {a, other}) for other in (b, c))
    longer = np.linalg.norm(corners[:, b] - corners[:, a], axis=1) >= np.linalg.norm(
        corners[:, c] - corners[:, a], axis=1)
    first = (a, on_b, on_c)
    return [(rows[longer], (first, (on_b, b, c), (on_b, c, on_c))),
            (rows[~longer], (first, (on_b, b, on_c), (on_c, b, c)))]


def _joined(facets: Facets, corners: Indices, local: Array, parent: Indices) -> Facets:
    """Pieces with corners (t, 3), numbered as nodes, at places (t, 3, 2) of their parents."""
    middles = np.stack([(local[:, a] + local[:, b]) / 2 for a, b, _ in EDGES], axis=1)
    place = functions(np.concatenate([local, middles], axis=1)) @ facets.nodes_m[facets.cells[parent]]
    used, corners = np.unique(corners, return_inverse=True)
    corners = corners.reshape(-1, 3)
    nodes = np.empty((len(used), 3))
    nodes[corners.T.ravel()] = place[:, :3].swapaxes(0, 1).reshape(-1, 3)
    first, number, _ = _edges(corners)
    on_edges = place[:, 3:].swapaxes(0, 1).reshape(-1, 3)[first]
    cells = np.column_stack([corners, len(nodes) + number.reshape(len(EDGES), -1).T])
    return Facets(np.vstack([nodes, on_edges]), cells, facets.electrode[parent], facets.factor[parent],
                  facets.parent[parent])


def halved(facets: Facets, marked: NDArray[np.bool_]) -> Facets:
    """The sheet with all edges of the marked triangles (t,) halved, and the longest one of every triangle that these
    cut."""
    _, own = facets.edges
    length = facets.lengths_m(own)
    longest = own[np.arange(len(own)), np.argmax(length[own], axis=1)]
    cut = np.zeros(len(length), dtype=bool)
    cut[own[marked]] = True
    while True:
        more = longest[cut[own].any(axis=1)]
        if cut[more].all():
            return split(facets, cut, np.full(len(length), 0.5))
        cut[more] = True
