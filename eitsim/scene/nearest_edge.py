"""The edge of an outline next to a place: the disc whose rim it is part of there, and how near all other edges are."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.scene.polygons import Looped, corners_and_edges, edge_distance_m, inside, squared_distance
from touchcal.arrays import Array

STRAIGHT_M = 100.0  # Radius of the disc whose rim stands for a straight edge, m.
_STEPS = 400  # Edges count as points this part of the outline's size from each other.
_DIGITS = 9  # Edges whose directions and distances, m, are the same to so many digits lie on one line.
_ON = 0.005  # Edges whose distance from a rim is less than this share of that to the place are part of it.


@dataclass(frozen=True, eq=False)
class NearestEdge:
    """The nearest edge as part of the rim of a disc."""

    disc_m: float  # radius of the disc, m; STRAIGHT_M for a straight edge
    offset_m: float  # distance of the place from the disc's centre, m
    towards: Array  # (2,) direction from the disc's centre through the place, towards the edge
    others_m: Array  # (4,) distances of the place to edges off that rim, by quarters of the directions as below, m

    @property
    def distance_m(self) -> float:
        return self.disc_m - self.offset_m


def quarter_distances_m(outline: Looped, point_m: ArrayLike) -> Array:
    """Distances (4,), m, of a point (2,) on the skin to the edges and holes in the four quarters of all directions, the
    first about that to the nearest edge; infinite where a quarter has none. Edges count as points 1/400 of the outline
    from each other."""
    found = _by_quarter(_edge_points(outline) - np.asarray(point_m))
    found[0] = abs(edge_distance_m(outline, point_m))
    return found


def nearest_edge(outline: Looped, point_m: ArrayLike) -> NearestEdge:
    """Of a point (2,) on the skin, m: the straight edge, or the rim through the nearest point of the outline and those
    as far on either side as the point is away, whichever leaves the others further away."""
    point = np.asarray(point_m, dtype=float)
    start, end = corners_and_edges(outline)
    along = end - start
    way = np.clip(np.sum((point - start) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    feet = start + way[:, None] * along
    nearest = int(np.linalg.norm(point - feet, axis=1).argmin())
    distance = float(np.linalg.norm(feet[nearest] - point))
    normal = np.array([along[nearest, 1], -along[nearest, 0]]) / np.linalg.norm(along[nearest])
    towards = (feet[nearest] - point) / distance if distance > 0 else normal
    found = [_as_rim(outline, point, point - (STRAIGHT_M - distance) * towards, STRAIGHT_M, towards)]
    either = _on_either_side(outline, nearest, float(way[nearest]), distance)
    centre = _centre(either[0], feet[nearest], either[1])
    radius = math.inf if centre is None else float(np.linalg.norm(feet[nearest] - centre))
    if centre is not None and distance < radius < STRAIGHT_M and (centre - feet[nearest]) @ towards < 0:
        away = point - centre
        found.append(_as_rim(outline, point, centre, radius, away / max(np.linalg.norm(away), 1e-300)))
    return max(found, key=lambda edge: edge.others_m.min())


def _as_rim(outline: Looped, point: Array, centre: Array, radius: float, towards: Array) -> NearestEdge:
    at = _edge_points(outline)
    off = np.abs(np.linalg.norm(at - centre, axis=1) - radius) > _ON * np.linalg.norm(at - point, axis=1)
    return NearestEdge(radius, float(np.linalg.norm(point - centre)), towards, _by_quarter((at - point)[off], towards))


def _edge_points(outline: Looped) -> Array:
    """Points (n, 2) along all edges, m."""
    start, end = corners_and_edges(outline)
    step = float(np.ptp(outline.loops[0], axis=0).max()) / _STEPS
    pieces = np.ceil(np.linalg.norm(end - start, axis=1) / step).astype(int)
    edge = np.repeat(np.arange(len(start)), pieces)
    way = (np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[edge]
    return start[edge] + way[:, None] * (end - start)[edge]


def _by_quarter(offset: Array, towards: Array | None = None) -> Array:
    """Least lengths (4,) of offsets (n, 2) in the quarters of the directions, the first about `towards`, or about the
    shortest; infinite where a quarter has none."""
    away, angle = np.hypot(*offset.T), np.arctan2(offset[:, 1], offset[:, 0])
    first = math.atan2(towards[1], towards[0]) if towards is not None else angle[np.argmin(away)]
    quarter: NDArray[np.int64] = np.round((angle - first) / (math.pi / 2)).astype(int) % 4
    return np.array([np.min(away[quarter == k], initial=np.inf) for k in range(4)])


def _on_either_side(outline: Looped, edge: int, way: float, length: float) -> tuple[Array, Array]:
    """Points of the loop of an edge, a length before and after a place on it, at most a sixth of the loop, m."""
    parts = outline.loops
    ends = np.cumsum([len(part) for part in parts])
    which = int(np.searchsorted(ends, edge, side="right"))
    loop, edge = parts[which], edge - (0 if which == 0 else int(ends[which - 1]))
    closed = np.vstack([loop, loop[:1]])
    up_to = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    here = up_to[edge] + way * (up_to[edge + 1] - up_to[edge])
    aside = (here + min(length, up_to[-1] / 6) * np.array([-1, 1])) % up_to[-1]
    before, after = np.column_stack([np.interp(aside, up_to, part) for part in closed.T])
    return before, after


def _centre(a: Array, b: Array, c: Array) -> Array | None:
    """Centre (2,) of the circle through three points; None where they lie on a line."""
    p, q = a - b, c - b
    twice = 2 * (p[0] * q[1] - p[1] * q[0])
    if abs(twice) <= 1e-9 * np.linalg.norm(p) * np.linalg.norm(q):
        return None
    return b + np.array([q[1] * (p @ p) - p[1] * (q @ q), p[0] * (q @ q) - q[0] * (p @ p)]) / twice


def straight_edges(outline: Looped, point_m: ArrayLike, reach_m: float) -> list[tuple[Array, float]]:
    """Directions (2,) towards the straight edges nearer to a place on the skin than a reach, and their distances, m,
    where they alone bound the skin that near, as whole lines that meet at right or acute angles; none where they do
    not: near re-entrant, obtuse and round corners and holes."""
    point, (start, end) = np.asarray(point_m, dtype=float), corners_and_edges(outline)
    near = squared_distance(point, start, end) < reach_m**2
    along = (end - start)[near]
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    away = np.sum((start[near] - point) * normal, axis=1)
    lines = np.unique(np.round(np.column_stack([normal, away]), _DIGITS), axis=0)
    between = lines[:, :2] @ lines[:, :2].T - 2 * np.eye(len(lines))
    if np.any(between > 10.0**-_DIGITS) or np.any(lines[:, 2] <= 0):
        return []
    radius, angle = np.linspace(0, reach_m, 25)[1:], np.arange(96) / 96 * 2 * np.pi
    offset = radius[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    left = (lines[:, 2] - offset @ lines[:, :2].T).min(axis=-1, initial=np.inf)
    clear = np.abs(left) > 1e-3 * reach_m
    if np.any((inside(point + offset, start, end) != (left > 0))[clear]):
        return []
    return [(line[:2], float(line[2])) for line in lines]
