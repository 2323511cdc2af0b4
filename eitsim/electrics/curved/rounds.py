"""Round parts of a sheet in space, cut out by balls: their edges become edges of quadratic triangles."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from eitsim.electrics.cem.assembly import Array, Indices
from eitsim.electrics.curved.facets import CORNERS, Facets, halved, slopes, split
from eitsim.electrics.mesh.p2_triangles import EDGES
from eitsim.scene.triangles.solid import flat_nearest

_CHORDS = 8  # Edges about a round part, about, at least: parabolas that leave it its area in the plane.
_MARGIN = 0.25  # A triangle nearer to the ball's surface than this part of its longest edge is small too.
_FINER = 3  # Times that there may be twice as many, where triangles fold over.
_ON = 0.4  # A corner nearer to the ball than this part of its shortest edge is moved onto it.
_CREASE = 0.3  # Angle, rad, between triangles and their mean, from which on their common corner stays.
_LEAST_TURN = 0.1  # Least area of a triangle at any place over its plane one that a curved edge may leave.
_BISECTIONS = 40  # To find where an edge meets a ball.
_HALVINGS = 40  # Of triangles at the edge of a round part, at most.


@dataclass(frozen=True, eq=False)
class Ball:
    """Cuts a round part out of a sheet."""

    centre_m: Array  # (3,) m
    radius_m: float  # m
    chords: int = _CHORDS  # edges about the part, about, at least


def refined_at(facets: Facets, balls: Sequence[Ball]) -> Facets:
    """The sheet with triangles small enough where balls' surfaces may cut them."""
    for _ in range(_HALVINGS):
        corners, nodes = facets.corners_m, facets.nodes_m[facets.cells]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        large = np.zeros(len(longest), dtype=bool)
        for ball in balls:
            away = np.linalg.norm(nodes - ball.centre_m, axis=2)
            tried = np.flatnonzero((longest > 2 * np.pi * ball.radius_m / ball.chords)
                                   & (away.min(axis=1) < ball.radius_m + longest))
            miss = np.sqrt(flat_nearest(corners[tried], ball.centre_m[None])[1])
            near = miss < ball.radius_m + _MARGIN * longest[tried]
            large[tried] |= near & (away[tried].max(axis=1) > ball.radius_m - _MARGIN * longest[tried])
        if not large.any():
            break
        facets = halved(facets, large)
    return facets


def cut_out(facets: Facets, centre_m: Array, radius_m: float) -> tuple[Facets, NDArray[np.bool_]]:
    """The sheet cut along the surface of a ball, and which of its triangles (t,) lie inside, in one piece with the
    point nearest to the centre. Corners near the ball are moved onto it along the sheet, and so are the middles of the
    new edges; triangles are cut smaller where these would fold."""
    for times in range(_FINER + 1):
        facets = refined_at(facets, [Ball(centre_m, radius_m, _CHORDS << times)])
        cut, inside, smooth = _cut(facets, centre_m, radius_m)
        if smooth:
            break
    return cut, inside


def _cut(facets: Facets, centre: Array, radius: float) -> tuple[Facets, NDArray[np.bool_], bool]:
    """As `cut_out`, and whether every new edge is curved."""
    facets, side = _snapped(facets, centre, radius)
    ends, own = facets.edges
    crossed = side[ends[:, 0]] * side[ends[:, 1]] < 0
    out = split(facets, crossed, _shares(facets, ends, own, crossed, centre, radius))
    # corners of the pieces lie on one side or on the ball: the one that is furthest off shows the side
    off = np.linalg.norm(out.corners_m - centre, axis=2) - radius
    inside = _one_piece(out, off[np.arange(len(off)), np.argmax(np.abs(off), axis=1)] < 0, centre)
    rounded, smooth = _rounded(out, inside, centre, radius)
    return rounded, inside, smooth


def _snapped(facets: Facets, centre: Array, radius: float) -> tuple[Facets, Indices]:
    """The sheet with its corners near the ball moved onto it, and the side of the ball (nodes,) of each: -1 inside, 0
    on it, 1 outside."""
    ends, own = facets.edges
    nodes, corner = facets.nodes_m, facets.cells[:, :3].ravel()
    shortest = np.full(len(nodes), np.inf)
    np.minimum.at(shortest, ends.ravel(), np.repeat(facets.lengths_m(own), 2))
    away = np.linalg.norm(nodes - centre, axis=1) - radius
    near = np.isfinite(shortest) & (np.abs(away) < _ON * np.where(np.isfinite(shortest), shortest, 0.0))
    mean, any_normal = np.zeros_like(nodes), np.zeros_like(nodes)
    normal = np.repeat(_normals(facets), 3, axis=0)
    any_normal[corner] = normal
    normal = np.where(np.sum(normal * any_normal[corner], axis=1, keepdims=True) < 0, -normal, normal)
    np.add.at(mean, corner, normal)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), np.finfo(float).tiny)
    bend = np.zeros(len(nodes))
    np.maximum.at(bend, corner, np.arccos(np.clip(np.sum(normal * mean[corner], axis=1), -1, 1)))
    rim = np.zeros(len(nodes), dtype=bool)
    rim[ends[np.bincount(own.ravel()) == 1]] = True
    free = np.flatnonzero(near & (bend < _CREASE) & ~rim)
    shift = np.zeros_like(nodes)
    shift[free] = _onto_ball(nodes[free], mean[free], centre, radius) - nodes[free]
    for k, (a, b, _) in enumerate(EDGES):
        shift[facets.cells[:, 3 + k]] = (shift[facets.cells[:, a]] + shift[facets.cells[:, b]]) / 2
    return replace(facets, nodes_m=nodes + shift), np.where(near, 0, np.sign(away)).astype(int)


def _normals(facets: Facets) -> Array:
    """Unit normals (t, 3) of the plane triangles between the corners."""
    a, b, c = np.moveaxis(facets.corners_m, 1, 0)
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _onto_ball(points: Array, normals: Array, centre: Array, radius: float | Array) -> Array:
    """Points (n, 3) moved in the planes of normals (n, 3) to distances, one or (n,), from a ball's centre; where a
    plane misses such a ball they stay."""
    off = points - centre
    height = np.sum(off * normals, axis=1, keepdims=True)
    flat = off - height * normals
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    reach = np.sqrt(np.maximum(np.reshape(radius, (-1, 1)) ** 2 - height**2, 0.0))
    return np.where((reach > 0) & (length > 0), points + (reach / np.maximum(length, np.finfo(float).tiny) - 1) * flat,
                    points)


def _rounded(facets: Facets, inside: NDArray[np.bool_], centre: Array, radius: float) -> tuple[Facets, bool]:
    """The sheet with the middles of the edges of a part on the ball, where these do not run along creases and fold no
    triangle; and whether none would be folded."""
    ends, own = facets.edges
    count, normal = len(ends), _normals(facets)
    first, last = np.full(count, -1), np.full(count, -1)
    middle = np.empty(count, dtype=np.int64)
    for k in range(3):
        middle[own[:, k]] = facets.cells[:, 3 + k]
        first[own[inside, k]] = np.flatnonzero(inside)
        last[own[~inside, k]] = np.flatnonzero(~inside)
    rim = np.flatnonzero((first >= 0) & (last >= 0))
    rim = rim[np.abs(np.sum(normal[first[rim]] * normal[last[rim]], axis=1)) > np.cos(_CREASE)]
    nodes = facets.nodes_m.copy()
    chord = np.linalg.norm(nodes[ends[rim, 0]] - nodes[ends[rim, 1]], axis=1)
    nodes[middle[rim]] = _onto_ball(nodes[middle[rim]], normal[first[rim]], centre, _true_to_area(radius, chord))
    moved, folded = np.zeros(len(nodes), dtype=bool), np.zeros(len(nodes), dtype=bool)
    moved[middle[rim]] = True
    near = facets.cells[moved[facets.cells[:, 3:]].any(axis=1)]
    folded[near[_folds(nodes[near])][:, 3:]] = True
    back = middle[rim][folded[middle[rim]]]
    nodes[back] = facets.nodes_m[back]
    return replace(facets, nodes_m=nodes), not len(back)


def _true_to_area(radius: float, chord: Array) -> Array:
    """Distances (n,) from a circle's centre of the middles of parabolas over chords (n,) that cut off what the circle
    does: two thirds of chord times height."""
    half = np.arcsin(np.minimum(chord / (2 * radius), 1.0))
    height = 3 * radius**2 * (half - np.sin(half) * np.cos(half)) / (2 * np.maximum(chord, np.finfo(float).tiny))
    return radius * np.cos(half) + height


def _folds(nodes: Array) -> NDArray[np.bool_]:
    """Which of the quadratic triangles (t, 6, 3) turn over, or nearly so, at a corner or at the middle of an edge."""
    at = np.vstack([CORNERS, (CORNERS + np.roll(CORNERS, -1, axis=0)) / 2])
    tangents = np.einsum("tkx,pkb->tpbx", nodes, slopes(at))
    turn = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    plain = np.cross(nodes[:, 1] - nodes[:, 0], nodes[:, 2] - nodes[:, 0])
    return np.min(np.einsum("tpx,tx->tp", turn, plain), axis=1) < _LEAST_TURN * np.sum(plain**2, axis=1)


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
