"""Closed polygons in the plane: areas, distances, crossings; an outer edge and its holes are loops of corners."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchcal.arrays import Array

KINDS = ("rectangle", "polygon")  # Edges of a skin that are polygons, by the names of a scene file.
MOST_POINTS = 2000  # Corners of an outline with its holes, at most.
ROUND = 72  # Chords of a round hole: they enclose the area of the arc, so that they lie as much outside it as inside.
# (start, end) (edges, 2), m, ends of edges about a place
Edges = tuple[Array, Array]
_PAIRS = 2**20  # Pairs of points and edges that are looked at together.


class Looped(Protocol):
    """What has closed edges."""

    @property
    def loops(self) -> tuple[Array, ...]:
        """Corners (n, 2), m, of the outer edge, counter-clockwise, then of every hole, clockwise."""
        ...


@dataclass(frozen=True, eq=False)
class Loops:
    """Closed edges as they are given."""

    loops: tuple[Array, ...]


def circle(centre_m: ArrayLike, radius_m: float, chords: int = ROUND) -> Array:
    """Corners (chords, 2), m, of the regular polygon with a circle's centre and area."""
    step = 2 * math.pi / chords
    angle = step * np.arange(chords)
    return np.asarray(centre_m) + radius_m * math.sqrt(step / math.sin(step)) * np.column_stack(
        [np.cos(angle), np.sin(angle)])


def turned(loop: Array, sign: float) -> Array:
    """The loop counter-clockwise, 1, or clockwise, -1, a repeated first corner left out."""
    if len(loop) > 1 and np.array_equal(loop[0], loop[-1]):
        loop = loop[:-1]
    return loop.copy() if signed_area(loop) * sign >= 0 else loop[::-1].copy()


def signed_area(loop: Array) -> float:
    """Area, m^2, of a closed polygon (n, 2), positive counter-clockwise."""
    x, y = loop.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def area_m2(outline: Looped) -> float:
    """Area of an outline, less its holes, m^2."""
    return sum(signed_area(loop) for loop in outline.loops)


def centroid_m(outline: Looped) -> Array:
    """Centroid (2,) of the outer edge, m."""
    loop = outline.loops[0]
    after = np.roll(loop, -1, axis=0)
    cross = loop[:, 0] * after[:, 1] - after[:, 0] * loop[:, 1]
    return (cross @ (loop + after)) / (3 * cross.sum())


def moments_m(outline: Looped) -> tuple[Array, Array]:
    """Centroid (2,), m, of an outline, without its holes, and the means (2, 2), m^2, of the products of
    coordinates about it."""
    start, end = corners_and_edges(outline)
    cross = start[:, 0] * end[:, 1] - end[:, 0] * start[:, 1]
    middle = cross @ (start + end) / (3 * cross.sum())
    products = sum(one[:, :, None] * other[:, None] for one in (start, end) for other in (start, end))
    products = products + start[:, :, None] * start[:, None] + end[:, :, None] * end[:, None]
    second = np.tensordot(cross, products, 1) / (12 * cross.sum())
    return middle, second - np.outer(middle, middle)


def corners_and_edges(outline: Looped) -> tuple[Array, Array]:
    """Starts and ends (n, 2), m, of all edges, those of the outer edge first."""
    parts = outline.loops
    return np.vstack(parts), np.vstack([np.roll(part, -1, axis=0) for part in parts])


def inside(points_m: Array, corners: Array, ends: Array) -> NDArray[np.bool_]:
    """Which points (..., 2) lie inside the closed polygons of these edges, holes left out: crossings to the right."""
    rise = np.where(corners[:, 1] == ends[:, 1], 1.0, ends[:, 1] - corners[:, 1])
    slope = (ends[:, 0] - corners[:, 0]) / rise
    points = np.reshape(points_m, (-1, 2))
    odd = np.empty(len(points), dtype=bool)
    step = max(_PAIRS // len(corners), 1)
    for first in range(0, len(points), step):
        x, y = points[first:first + step, 0, None], points[first:first + step, 1, None]
        across = (corners[:, 1] > y) != (ends[:, 1] > y)
        odd[first:first + step] = np.sum(across & (x < corners[:, 0] + (y - corners[:, 1]) * slope), axis=1) % 2 == 1
    return odd.reshape(points_m.shape[:-1])


def edge_distance_m(outline: Looped, points_m: ArrayLike) -> Array:
    """Distance (...) of points (..., 2) to the nearest edge or hole of an outline, m; negative outside."""
    points, (start, end) = np.asarray(points_m, dtype=float), corners_and_edges(outline)
    away = np.sqrt(squared_distance(points[..., None, :], start, end).min(axis=-1))
    return np.where(inside(points, start, end), away, -away)


def squared_distance(points: Array, start: Array, end: Array) -> Array:
    """Squared distances (...) of points to edges, each (..., 2)."""
    along = end - start
    way = np.clip(np.sum((points - start) * along, axis=-1) / np.sum(along**2, axis=-1), 0, 1)
    return np.sum((points - start - way[..., None] * along) ** 2, axis=-1)


def distance_to(path: Array, point: Array) -> float:
    """Distance of a point (2,) to a path (n, 2), or to what it surrounds where its last point is its first."""
    start, end = path[:-1], path[1:]
    if np.array_equal(path[0], path[-1]) and inside(point, start, end):
        return 0.0
    return math.sqrt(float(squared_distance(point, start, end).min()))


def touching(start: Array, end: Array, starts: Array, ends: Array, within: float) -> NDArray[np.bool_]:
    """Which edges (n, 2) cross an edge (2,) or come closer to it than `within`, m."""
    def side(a: Array, b: Array, p: Array) -> Array:
        return (b[..., 0] - a[..., 0]) * (p[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (p[..., 0] - a[..., 0])

    crossing = (side(start, end, starts) * side(start, end, ends) < 0) & (
        side(starts, ends, start) * side(starts, ends, end) < 0)
    near = np.minimum(np.minimum(squared_distance(starts, start, end), squared_distance(ends, start, end)),
                      np.minimum(squared_distance(start, starts, ends), squared_distance(end, starts, ends)))
    return crossing | (near < within**2)
