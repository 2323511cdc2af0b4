"""Electrodes on a skin with an outline: stretches of its outer edge, or patches anywhere on its surface."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from eitsim.scene.electrodes import SHAPES, TOUCHING, Electrodes, check_sizes, lengths, require, turns, widths
from eitsim.scene.outline_edge import arc_at, edge_starts, places_along
from eitsim.scene.polygons import (
    Looped,
    circle,
    corners_and_edges,
    edge_distance_m,
    inside,
    touching,
)
from touchcal.arrays import Array

_CHORDS = 16  # Corners of a round electrode, which has the circle's area; of a sector on its arc, at most.
_CLOSEST = 1e-6  # Least gap between electrodes on the surface, or to an edge, over the outline's size.


def stretches_along(outline: Looped, electrodes: Electrodes) -> Array:
    """First and last arc length (count, 2), m, of line electrodes from the outer edge's first corner.

    Middles are those of `angles_rad`, or lie `positions_m` or `shares` of the length counter-clockwise from the
    direction of `first_angle_rad`, evenly unless given. ValueError where they overlap.
    """
    whole = edge_starts(outline)[-1]
    if electrodes.angles_rad:
        middle = np.array([arc_at(outline, angle) for angle in electrodes.angles_rad])
    else:
        shares = electrodes.shares or np.arange(electrodes.count) / electrodes.count
        from_first = np.array(electrodes.positions_m) if electrodes.positions_m else whole * np.array(shares)
        middle = arc_at(outline, electrodes.first_angle_rad) + from_first
    ends = middle[:, None] + widths(electrodes)[:, None] / 2 * np.array([-1.0, 1.0])
    order = np.argsort(np.mod(middle, whole))
    middle, half = np.mod(middle, whole)[order], widths(electrodes)[order] / 2
    gaps = np.append(middle[1:], middle[0] + whole) - middle - half - np.roll(half, -1)
    k = int(np.argmin(gaps))
    require(gaps[k] > -TOUCHING * whole, "width_mm",
            f"electrodes {order[k]} and {order[(k + 1) % len(order)]} (from 0) overlap by {-gaps[k] * 1e3:.3g} mm of "
            f"the outline's {whole * 1e3:.4g}; place them further from each other or make them narrower")
    return ends


def along_edge(outline: Looped, electrodes: Electrodes) -> Array:
    """Middles (count,) of line electrodes as `positions_m` gives them: arc lengths from the direction of
    `first_angle_rad`, m."""
    return stretches_along(outline, electrodes).mean(axis=1) - arc_at(outline, electrodes.first_angle_rad)


def with_positions(outline: Looped, electrodes: Electrodes, offset_m: ArrayLike = 0.0) -> Electrodes:
    """Line electrodes given by `positions_m`, each further along the edge by an offset (count,), m."""
    positions = along_edge(outline, electrodes) + np.asarray(offset_m, dtype=float)
    return replace(electrodes, angles_rad=(), shares=(), positions_m=tuple(positions.tolist()))


def patch_loops(electrodes: Electrodes) -> list[Array]:
    """Corners (n, 2), m, counter-clockwise, of each electrode on the surface; round ones keep the circle's area.
    None of electrodes at the edge."""
    if not electrodes.anywhere:
        return []
    sizes = zip(electrodes.x_m, electrodes.y_m, _shapes(electrodes), widths(electrodes), lengths(electrodes),
                turns(electrodes), strict=True)
    return [np.array([x, y]) + _patch(shape, width, length, electrodes.opening_rad) @ _rotation(turn)
            for x, y, shape, width, length, turn in sizes]


def _shapes(electrodes: Electrodes) -> tuple[str, ...]:
    given = electrodes.shape
    return (given,) * electrodes.count if isinstance(given, str) else given


def _patch(shape: str, width: float, length: float, opening: float) -> Array:
    """Corners about the electrode's own point: the middle, of a sector its tip."""
    if shape == "disc":
        return circle(np.zeros(2), width / 2, _CHORDS)
    if shape == "rectangle":
        return np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [width / 2, length / 2]
    chords = max(2, math.ceil(_CHORDS * opening / (2 * math.pi)))
    step = opening / chords
    angle = step * np.arange(chords + 1) - opening / 2
    arc = length * math.sqrt(step / math.sin(step)) * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.zeros((1, 2)), arc])


def _rotation(turn: float) -> Array:
    return np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])


def middles_m(outline: Looped, electrodes: Electrodes) -> Array:
    """Middles (count, 2), m, of the electrodes."""
    if loops := patch_loops(electrodes):
        return np.array([loop.mean(axis=0) for loop in loops])
    return places_along(outline, stretches_along(outline, electrodes).mean(axis=1))


def check_on_outline(outline: Looped, electrodes: Electrodes) -> None:
    """ValueError where electrodes overlap, lie off the skin or cannot be as they are given; names the key."""
    require(not electrodes.at_rim, "kind", "\"patch\" is a sector at the rim of a disc; with an outline give kind "
            "= \"line\", or \"surface\" with x_mm and y_mm")
    check_sizes(electrodes)
    if electrodes.along_edge:
        _check_line(electrodes)
        stretches_along(outline, electrodes)
        return
    _check_patches(outline, electrodes)


def _check_line(electrodes: Electrodes) -> None:
    given = [key for key, value in (("angles_deg", electrodes.angles_rad), ("positions_mm", electrodes.positions_m),
                                    ("shares", electrodes.shares)) if value]
    require(len(given) <= 1, "".join(given[1:2]), f"has no effect with {''.join(given[:1])}; leave one of them out")


def _check_patches(outline: Looped, electrodes: Electrodes) -> None:
    require(len(electrodes.x_m) == len(electrodes.y_m) == electrodes.count, "x_mm and y_mm",
            f"must hold {electrodes.count} numbers each, one an electrode, got {len(electrodes.x_m)} and "
            f"{len(electrodes.y_m)}")
    shapes = _shapes(electrodes)
    for shape in shapes:
        require(shape in SHAPES, "shape", f"'{shape}' is unknown; known: {', '.join(SHAPES)}")
    require(len(shapes) == electrodes.count, "shape", f"must be one word or {electrodes.count}, got {len(shapes)}")
    require(np.all(lengths(electrodes) > 0), "length_mm", "must be positive")
    require("sector" not in shapes or 0 < electrodes.opening_rad < math.pi, "opening_deg", "of a sector must lie "
            f"between 0 and 180, got {math.degrees(electrodes.opening_rad):g}")
    patches = patch_loops(electrodes)
    start, end = corners_and_edges(outline)
    least = _CLOSEST * float(np.ptp(outline.loops[0], axis=0).max())
    middle = np.array([patch.mean(axis=0) for patch in patches])
    reach = np.array([np.linalg.norm(patch - at, axis=1).max() for patch, at in zip(patches, middle, strict=True)])
    room = edge_distance_m(outline, middle)
    for k, patch in enumerate(patches):
        near = room[k] <= reach[k] + least
        off = room[k] < 0 or (near and (_touches(patch, start, end, least) or inside(
            start, patch, np.roll(patch, -1, axis=0)).any()))
        require(not off, "x_mm and y_mm", f"electrode {k} (from 0) lies off the skin, or on its edge; move it inwards")
        for j in np.flatnonzero(np.linalg.norm(middle[:k] - middle[k], axis=1) < reach[:k] + reach[k] + least):
            require(not _overlap(patch, patches[j], least), "x_mm and y_mm", f"electrodes {j} and {k} (from 0) overlap "
                    "or touch; place them further from each other or make them smaller")


def _overlap(one: Array, other: Array, within: float) -> bool:
    ends, others = np.roll(one, -1, axis=0), np.roll(other, -1, axis=0)
    return bool(_touches(one, other, others, within) or inside(one[0], other, others) or inside(other[0], one, ends))


def _touches(patch: Array, start: Array, end: Array, within: float) -> bool:
    return any(touching(a, b, start, end, within).any() for a, b in zip(patch, np.roll(patch, -1, axis=0), strict=True))
