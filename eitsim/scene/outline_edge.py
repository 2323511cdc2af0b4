"""Arc lengths along the outer edge of a skin with an outline, and the points that they lead to."""

import math

import numpy as np

from eitsim.scene.polygons import Looped, centroid_m
from touchcal.arrays import Array


def edge_starts(outline: Looped) -> Array:
    """Arc lengths (n + 1,), m, of the outer edge's corners from its first one, the whole length last."""
    loop = outline.loops[0]
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1))])


def places_along(outline: Looped, arc_m: Array) -> Array:
    """Points (..., 2), m, of the outer edge at arc lengths (...) from its first corner, counter-clockwise."""
    loop, starts = outline.loops[0], edge_starts(outline)
    closed, arc = np.vstack([loop, loop[:1]]), np.mod(arc_m, starts[-1])
    return np.stack([np.interp(arc, starts, closed[:, i]) for i in (0, 1)], axis=-1)


def path_along(outline: Looped, first_m: float, last_m: float) -> Array:
    """Points (n, 2), m, of the outer edge from one arc length to another, its corners between them among them."""
    corners = edge_starts(outline)[None, :-1] + edge_starts(outline)[-1] * np.array([[-1], [0], [1]])
    return places_along(outline, np.sort([first_m, last_m, *corners[(corners > first_m) & (corners < last_m)]]))


def arcs_of(outline: Looped, points_m: Array) -> tuple[Array, Array]:
    """Arc lengths (n,), m, of the outer edge's points next to points (n, 2), and the distances (n,) to them, m."""
    start = outline.loops[0]
    along = np.roll(start, -1, axis=0) - start
    squared = np.sum(along**2, axis=1)
    way = np.clip(np.sum((points_m[:, None] - start) * along, axis=-1) / squared, 0, 1)
    away = np.linalg.norm(points_m[:, None] - start - way[..., None] * along, axis=-1)
    nearest = away.argmin(axis=1)
    own = np.arange(len(points_m)), nearest
    return edge_starts(outline)[nearest] + way[own] * np.sqrt(squared[nearest]), away[own]


def arc_at(outline: Looped, angle_rad: float) -> float:
    """Arc length, m, of the outermost point of the outer edge in a direction from its centroid.

    ValueError where no part of the edge lies in that direction.
    """
    loop, centre, starts = outline.loops[0], centroid_m(outline), edge_starts(outline)
    way = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    a, b = loop - centre, np.roll(loop, -1, axis=0) - centre
    left, right = way[0] * a[:, 1] - way[1] * a[:, 0], way[0] * b[:, 1] - way[1] * b[:, 0]
    across = (left <= 0) != (right <= 0)
    share = np.where(across, left / np.where(across, left - right, 1.0), 0.0)
    reach = np.where(across, (a + share[:, None] * (b - a)) @ way, -np.inf)
    k = int(np.argmax(reach))
    if not reach[k] > 0:
        raise ValueError(f"angles_deg in [electrodes]: no edge lies at {math.degrees(angle_rad):g} degrees from the "
                         "outline's centroid; give shares or positions_mm from another first_angle_deg.")
    return float(starts[k] + share[k] * (starts[k + 1] - starts[k]))
