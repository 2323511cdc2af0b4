"""Round parts of a sheet in space, cut out by balls: their edges become edges of triangles."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from eitsim.electrics.cem.assembly import Array, Indices
from eitsim.electrics.curved.facets import Facets, halved, split

_CHORDS = 24  # Chords about a round part, about, at least.
_MOVES = 3  # Times that the ball grows for the chords' area.
_ON = 0.05  # A corner is on a ball where it is nearer to it than this part of its edges.
_BISECTIONS = 40  # To find where an edge meets a ball.
_HALVINGS = 40  # Of triangles at the edge of a round part, at most.


def refined_at(facets: Facets, centre_m: Array, radius_m: float) -> Facets:
    """The sheet with triangles small enough where a ball's surface may cut them."""
    size = 2 * np.pi * radius_m / _CHORDS
    for _ in range(_HALVINGS):
        away = np.linalg.norm(facets.nodes_m[facets.cells] - centre_m, axis=2)
        corners = facets.corners_m
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        # the ball's surface is nearer than the triangle's own size
        near = (away.min(axis=1) < radius_m + longest / 4) & (away.max(axis=1) > radius_m - longest / 4)
        inside = away.min(axis=1) - longest < radius_m
        large = (longest > size) & (near | (inside & (longest > radius_m)))
        if not large.any():
            break
        facets = halved(facets, large)
    return facets


def cut_out(facets: Facets, centre_m: Array, radius_m: float) -> tuple[Facets, NDArray[np.bool_]]:
    """The sheet cut along the surface of a ball, and which of its triangles (t,) lie inside, in one piece with the
    point nearest to the centre. The chords that stand for the arcs are moved outwards so that the area is the ball's.
    """
    radius = radius_m
    for _ in range(_MOVES):
        cut, inside = _cut(facets, centre_m, radius)
        radius += _short(cut, inside, centre_m, radius_m)
    return _cut(facets, centre_m, radius)


def _cut(facets: Facets, centre: Array, radius: float) -> tuple[Facets, NDArray[np.bool_]]:
    ends, own = facets.edges
    away = np.linalg.norm(facets.nodes_m - centre, axis=1) - radius
    length = facets.lengths_m(own)
    shortest = np.full(len(away), np.inf)
    np.minimum.at(shortest, ends.ravel(), np.repeat(length, 2))
    side = np.where(np.abs(away) < _ON * np.where(np.isfinite(shortest), shortest, 0.0), 0, np.sign(away)).astype(int)
    crossed = side[ends[:, 0]] * side[ends[:, 1]] < 0
    out = split(facets, crossed, _shares(facets, ends, own, crossed, centre, radius))
    # corners of the pieces lie on one side or on the ball: the one that is furthest off shows the side
    off = np.linalg.norm(out.corners_m - centre, axis=2) - radius
    inside = off[np.arange(len(off)), np.argmax(np.abs(off), axis=1)] < 0
    return out, _one_piece(out, inside, centre)


def _shares(facets: Facets, ends: Indices, own: Indices, crossed: NDArray[np.bool_], centre: Array,
            radius: float) -> Array:
    """How far along from their lower ends (edges,) the crossed edges meet the ball; 1/2 on the others."""
    middle = np.empty(len(ends), dtype=np.int64)
    for k in range(3):
        middle[own[:, k]] = facets.cells[:, 3 + k]
    a, b, m = (facets.nodes_m[index[crossed]] for index in (ends[:, 0], ends[:, 1], middle))
    low, high = np.zeros(len(a)), np.ones(len(a))
    outwards = np.linalg.norm(a - centre, axis=1) < radius
    for _ in range(_BISECTIONS):
        t = ((low + high) / 2)[:, None]
        place = (1 - t) * (1 - 2 * t) * a + t * (2 * t - 1) * b + 4 * t * (1 - t) * m
        before = (np.linalg.norm(place - centre, axis=1) < radius) == outwards
        low, high = np.where(before, t[:, 0], low), np.where(before, high, t[:, 0])
    out = np.full(len(ends), 0.5)
    out[crossed] = (low + high) / 2
    return out


def _one_piece(facets: Facets, inside: NDArray[np.bool_], centre: Array) -> NDArray[np.bool_]:
    """Of the triangles inside, those joined by edges to the one nearest to the centre."""
    kept = np.flatnonzero(inside)
    if not len(kept):
        return inside
    _, own = facets.edges
    edge = own[kept]
    shared = coo_matrix((np.ones(edge.size), (np.repeat(np.arange(len(kept)), 3), edge.ravel()))).tocsr()
    _, part = connected_components(shared @ shared.T, directed=False)
    nearest = np.argmin(np.linalg.norm(facets.nodes_m[facets.cells[kept]] - centre, axis=2).min(axis=1))
    out = np.zeros(len(inside), dtype=bool)
    out[kept[part == part[nearest]]] = True
    return out


def _short(facets: Facets, inside: NDArray[np.bool_], centre: Array, radius: float) -> float:
    """How far outwards, m, the edges of a part must move for its area to be that of the ball: each chord of length l
    misses l^3/(12 r), and what its ends lie inside the ball."""
    ends, own = facets.edges
    rim = (np.bincount(own[inside].ravel(), minlength=len(ends)) == 1) & (np.bincount(own.ravel()) == 2)
    if not rim.any():
        return 0.0
    a, b = (facets.nodes_m[ends[rim, k]] for k in (0, 1))
    length = np.linalg.norm(b - a, axis=1)
    within = radius - (np.linalg.norm(a - centre, axis=1) + np.linalg.norm(b - centre, axis=1)) / 2
    return float(np.sum(length**3 / (12 * radius) + length * within) / length.sum())
