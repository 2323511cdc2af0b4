"""Outlines of flat skins: the disc, rectangles and polygons, with holes; all but the disc are closed polygons."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchcal.arrays import Array

Point = tuple[float, ...]
Loop = tuple[Point, ...]

OUTLINES = ("disc", "rectangle", "polygon")
MOST_POINTS = 2000  # Corners of an outline with its holes, at most.
_PAIRS = 2**20  # Pairs of points and edges that are looked at together.
# Chords of a quarter of a rounded corner, and of a round hole: they enclose the area of the arc, so that they lie as
# much outside it as inside.
_QUARTER, _ROUND = 24, 72
_FARTHEST_M = 10.0  # Largest size, and coordinate, m.
_TOUCHING = 1e-7  # Edges closer than this share of the outline's size touch.


@dataclass(frozen=True, kw_only=True)
class Outline:
    """The edge of a flat skin; lengths in m, the middle of a rectangle at the origin."""

    outline: str = "disc"  # one of OUTLINES
    # sizes of a rectangle along x and y, and the radius that rounds its corners, m
    width_m: float | None = None
    height_m: float | None = None
    corner_radius_m: float | None = None
    points_m: Loop = ()  # corners (n, 2) of a polygon in order, m
    # holes: a circle as its centre and radius (3,), or a polygon as its corners (n, 2), m
    holes_m: tuple[Point | Loop, ...] = ()


@lru_cache(maxsize=64)
def loops(outline: Outline) -> tuple[Array, ...]:
    """Corners (n, 2), m, of the outer edge, counter-clockwise, then of every hole, clockwise; not of a disc."""
    if outline.outline == "rectangle":
        outer = _rectangle(outline.width_m or 0.0, outline.height_m or 0.0, outline.corner_radius_m or 0.0)
    else:
        outer = np.array(outline.points_m, dtype=float).reshape(-1, 2)
    holes = [_hole(hole) for hole in outline.holes_m]
    found = (_turned(outer, 1.0), *(_turned(hole, -1.0) for hole in holes))
    for loop in found:
        loop.flags.writeable = False
    return found


def _rectangle(width: float, height: float, corner: float) -> Array:
    centre = np.array([width / 2 - corner, height / 2 - corner])
    if corner == 0:
        return centre * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    step = math.pi / 2 / _QUARTER
    # radius of the inner corners by which the polygon has the area of the quarter circle
    a, b, c = (_QUARTER - 1) * math.sin(step) / 2, corner * math.sin(step / 2), -math.pi / 4 * corner**2
    radius = (-b + math.sqrt(b**2 - 4 * a * c)) / (2 * a)
    angle = np.concatenate([[0.0], step * (np.arange(_QUARTER) + 0.5), [math.pi / 2]])
    reach = np.concatenate([[corner], np.full(_QUARTER, radius), [corner]])
    quarter = reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    parts = []
    for k, (x, y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        turn = np.array([[math.cos(k * math.pi / 2), math.sin(k * math.pi / 2)],
                         [-math.sin(k * math.pi / 2), math.cos(k * math.pi / 2)]])
        parts.append(centre * (x, y) + quarter @ turn)
    points = np.vstack(parts)
    return points[np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > 1e-9 * (width + height)]


def circle(centre_m: ArrayLike, radius_m: float, chords: int = _ROUND) -> Array:
    """Corners (chords, 2), m, of the regular polygon with a circle's centre and area."""
    step = 2 * math.pi / chords
    angle = step * np.arange(chords)
    return np.asarray(centre_m) + radius_m * math.sqrt(step / math.sin(step)) * np.column_stack(
        [np.cos(angle), np.sin(angle)])


def _hole(hole: Point | Loop) -> Array:
    given = np.array(hole, dtype=float)
    return circle(given[:2], given[2]) if given.ndim == 1 else given


def _turned(loop: Array, sign: float) -> Array:
    """The loop counter-clockwise, 1, or clockwise, -1, a repeated first corner left out."""
    if len(loop) > 1 and np.array_equal(loop[0], loop[-1]):
        loop = loop[:-1]
    return loop.copy() if signed_area(loop) * sign >= 0 else loop[::-1].copy()


def signed_area(loop: Array) -> float:
    """Area, m^2, of a closed polygon (n, 2), positive counter-clockwise."""
    x, y = loop.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def area_m2(outline: Outline) -> float:
    """Area of an outline but the disc, less its holes, m^2."""
    return sum(signed_area(loop) for loop in loops(outline))


def centroid_m(outline: Outline) -> Array:
    """Centroid (2,) of the outer edge, m."""
    loop = loops(outline)[0]
    after = np.roll(loop, -1, axis=0)
    cross = loop[:, 0] * after[:, 1] - after[:, 0] * loop[:, 1]
    return (cross @ (loop + after)) / (3 * cross.sum())


def moments_m(outline: Outline) -> tuple[Array, Array]:
    """Centroid (2,), m, of an outline but the disc, without its holes, and the means (2, 2), m^2, of the products of
    coordinates about it."""
    start, end = corners_and_edges(outline)
    cross = start[:, 0] * end[:, 1] - end[:, 0] * start[:, 1]
    middle = cross @ (start + end) / (3 * cross.sum())
    products = sum(one[:, :, None] * other[:, None] for one in (start, end) for other in (start, end))
    products = products + start[:, :, None] * start[:, None] + end[:, :, None] * end[:, None]
    second = np.tensordot(cross, products, 1) / (12 * cross.sum())
    return middle, second - np.outer(middle, middle)


def corners_and_edges(outline: Outline) -> tuple[Array, Array]:
    """Starts and ends (n, 2), m, of all edges, those of the outer edge first."""
    parts = loops(outline)
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


def edge_distance_m(outline: Outline, points_m: ArrayLike) -> Array:
    """Distance (...) of points (..., 2) to the nearest edge or hole of an outline but the disc, m; negative outside."""
    points, (start, end) = np.asarray(points_m, dtype=float), corners_and_edges(outline)
    away = np.sqrt(squared_distance(points[..., None, :], start, end).min(axis=-1))
    return np.where(inside(points, start, end), away, -away)


def squared_distance(points: Array, start: Array, end: Array) -> Array:
    """Squared distances (...) of points to edges, each (..., 2)."""
    along = end - start
    way = np.clip(np.sum((points - start) * along, axis=-1) / np.sum(along**2, axis=-1), 0, 1)
    return np.sum((points - start - way[..., None] * along) ** 2, axis=-1)


@lru_cache(maxsize=64)
def check_outline(outline: Outline) -> None:
    """ValueError for an outline that crosses itself, and holes that touch it or each other; names the key of [body]."""
    _require(outline.outline in OUTLINES, "outline", f"'{outline.outline}' is unknown; known: {', '.join(OUTLINES)}, "
             "or in a scene file the name of a .csv, .dxf, .svg or mesh file")
    rectangle, polygon = outline.outline == "rectangle", outline.outline == "polygon"
    for key, value, takers in (("width_mm", outline.width_m, ("rectangle",)),
                               ("height_mm", outline.height_m, ("rectangle",)),
                               ("corner_radius_mm", outline.corner_radius_m, ("rectangle",)),
                               ("points_mm", outline.points_m or None, ("polygon",)),
                               ("holes_mm", outline.holes_m or None, ("rectangle", "polygon"))):
        used, instead = outline.outline in takers, " or ".join(f"\"{name}\"" for name in takers)
        _require(used or value is None, key, f"has no effect with outline = \"{outline.outline}\"; leave it out, or "
                 f"write outline = {instead}")
        _require(not used or value is not None or key in ("corner_radius_mm", "holes_mm"), key,
                 f"is missing, which outline = \"{outline.outline}\" needs")
    if outline.outline == "disc":
        return
    if rectangle:
        _check_rectangle(outline.width_m or 0.0, outline.height_m or 0.0, outline.corner_radius_m or 0.0)
    for name, points in [("points_mm", outline.points_m)] * polygon + [("holes_mm", h) for h in outline.holes_m]:
        _check_points(name, points)
    _check_loops(outline)


def _check_rectangle(width: float, height: float, corner: float) -> None:
    for key, size in (("width_mm", width), ("height_mm", height)):
        _require(0 < size <= _FARTHEST_M, key, f"must be positive and at most {_FARTHEST_M * 1e3:g}, got "
                 f"{size * 1e3:g}")
    _require(0 <= corner <= min(width, height) / 2 * (1 + 1e-12), "corner_radius_mm",
             f"must be 0 to half of the shorter side, {min(width, height) * 500:g}, got {corner * 1e3:g}")


def _check_points(name: str, points: Point | Loop) -> None:
    kinds = [isinstance(part, tuple) for part in points] if isinstance(points, tuple) else []
    if name == "holes_mm" and not all(kinds or [False]):
        _require(kinds == [False] * 3 and np.asarray(points[2:], dtype=float) > 0, name, "must be a list of circles "
                 "[x, y, radius] of a positive radius and lists of points [x, y], as in [[20, 0, 4]]")
    else:
        _require(len(points) >= 3 and all(kinds) and {len(np.ravel(p)) for p in points} == {2}, name,
                 f"must hold three points [x, y] or more, got {len(points)}")
    _require(np.all(np.abs(np.array(points, dtype=float)) <= _FARTHEST_M), name, f"must lie within {_FARTHEST_M:g} m "
             "of the origin")


def _check_loops(outline: Outline) -> None:
    parts = loops(outline)
    count = sum(map(len, parts))
    _require(count <= MOST_POINTS, "points_mm", f"the outline and its holes have {count} corners, at most "
             f"{MOST_POINTS} are taken; thin them out")
    start, end = corners_and_edges(outline)
    size = float(np.ptp(parts[0], axis=0).max())
    own = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    for i, length in enumerate(np.linalg.norm(end - start, axis=1)):
        _require(length > _TOUCHING * size, _key(own[i]), f"the corner {_place(start[i])} mm is given twice in a row")
    for i in range(len(start)):
        near = touching(start[i], end[i], start[i + 1:], end[i + 1:], _TOUCHING * size)
        for j in i + 1 + np.flatnonzero(near):
            next_to = own[i] == own[j] and (j == i + 1 or j - i == len(parts[own[i]]) - 1)
            if next_to and not _folded(start, end, i, int(j)):
                continue
            problem = (f"the edges from {_place(start[i])} and from {_place(start[j])} mm cross or touch; give the "
                       "corners in order along the edge" if own[i] == own[j] else
                       f"a hole touches {'the outline' if own[i] == 0 else 'another hole'}; leave skin between them")
            _require(False, _key(own[j]), problem)
    for k, hole in enumerate(parts[1:], 1):
        others = [part for m, part in enumerate(parts[1:], 1) if m != k]
        _require(_within(hole[0], parts[0]), "holes_mm", f"hole {k} lies outside the outline")
        _require(not any(_within(hole[0], other) for other in others), "holes_mm", f"hole {k} lies in another hole")


def _place(point_m: Array) -> str:
    return f"({point_m[0] * 1e3:g}, {point_m[1] * 1e3:g})"


def _key(loop: int) -> str:
    return "points_mm" if loop == 0 else "holes_mm"


def _within(point: Array, loop: Array) -> bool:
    return bool(inside(point, loop, np.roll(loop, -1, axis=0)))


def _folded(start: Array, end: Array, i: int, j: int) -> bool:
    """Whether the outline turns back on itself between neighbouring edges."""
    one, other = end[i] - start[i], end[j] - start[j]
    cross = one[0] * other[1] - one[1] * other[0]
    return bool(abs(cross) < 1e-9 * np.linalg.norm(one) * np.linalg.norm(other) and one @ other < 0)


def touching(start: Array, end: Array, starts: Array, ends: Array, within: float) -> NDArray[np.bool_]:
    """Which edges (n, 2) cross an edge (2,) or come closer to it than `within`, m."""
    def side(a: Array, b: Array, p: Array) -> Array:
        return (b[..., 0] - a[..., 0]) * (p[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (p[..., 0] - a[..., 0])

    crossing = (side(start, end, starts) * side(start, end, ends) < 0) & (
        side(starts, ends, start) * side(starts, ends, end) < 0)
    near = np.minimum(np.minimum(squared_distance(starts, start, end), squared_distance(ends, start, end)),
                      np.minimum(squared_distance(start, starts, ends), squared_distance(end, starts, ends)))
    return crossing | (near < within**2)


def _require(ok: object, key: str, expected: str) -> None:
    if not ok:
        raise ValueError(f"{key} in [body]: {expected}.")
