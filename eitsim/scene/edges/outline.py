"""The edge of a flat skin that is no disc: rectangles and polygons, with holes; all are closed polygons."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.scene.drive import as_tuples
from eitsim.scene.edges.outline_electrodes import check_on_outline, stretches_along, with_positions
from eitsim.scene.electrodes import PLACES, Electrodes
from eitsim.scene.nearest_edge import STRAIGHT_M, NearestEdge, nearest_edge, quarter_distances_m
from eitsim.scene.outline_edge import path_along, places_along
from eitsim.scene.polygons import (
    KINDS,
    MOST_POINTS,
    area_m2,
    circle,
    corners_and_edges,
    edge_distance_m,
    inside,
    moments_m,
    touching,
    turned,
)
from touchcal.arrays import Array

Point = tuple[float, ...]
Loop = tuple[Point, ...]

# Chords of a quarter of a rounded corner: they enclose the area of the arc, so that they lie as much outside it as
# inside.
_QUARTER = 24
_FARTHEST_M = 10.0  # Largest size, and coordinate, m.
_TOUCHING = 1e-7  # Edges closer than this share of the outline's size touch.


@dataclass(frozen=True)
class Outline:
    """A rectangle about the origin, or a polygon; lengths in m. ValueError names the key of [body] where it is none."""

    kind: str  # one of KINDS
    # sizes of a rectangle along x and y, and the radius that rounds its corners, m
    width_m: float | None = None
    height_m: float | None = None
    corner_radius_m: float | None = None
    points_m: Loop = ()  # corners (n, 2) of a polygon in order, m
    # holes: a circle as its centre and radius (3,), or a polygon as its corners (n, 2), m
    holes_m: tuple[Point | Loop, ...] = ()

    name = "the nearest edge of the skin"
    is_round = False
    table_rim_m = STRAIGHT_M
    corner = (1.0, 1.0, math.sqrt(2), math.sqrt(2))
    grids = ("square",)

    def __post_init__(self) -> None:
        for name in ("points_m", "holes_m"):
            object.__setattr__(self, name, as_tuples(getattr(self, name)))
        _check_outline(self)

    @property
    def loops(self) -> tuple[Array, ...]:
        """Corners (n, 2), m, of the outer edge, counter-clockwise, then of every hole, clockwise."""
        return _loops(self)

    @property
    def area_m2(self) -> float:
        return area_m2(self)

    @property
    def size_m(self) -> float:
        return math.sqrt(self.area_m2 / math.pi)

    @property
    def box_m(self) -> tuple[Array, Array]:
        return self.loops[0].min(axis=0), self.loops[0].max(axis=0)

    @property
    def moments_m(self) -> tuple[Array, Array]:
        return moments_m(self)

    def gap_m(self, points_m: ArrayLike) -> Array:
        return edge_distance_m(self, points_m)

    def contains(self, points_m: Array) -> NDArray[np.bool_]:
        return self.gap_m(points_m) >= 0

    def nearest(self, point_m: ArrayLike) -> NearestEdge:
        return nearest_edge(self, point_m)

    def inmost_m(self, points_m: Array) -> Array:
        return points_m[np.argmax(self.gap_m(points_m))]

    def quarters_m(self, point_m: ArrayLike) -> Array:
        return quarter_distances_m(self, point_m)

    def covered_rad(self, place_m: ArrayLike, radius_m: Array) -> Array:
        """As if no edge were nearer than its size."""
        return np.where(radius_m <= self.size_m, 2 * np.pi, 0.0)

    def stretches_m(self, electrodes: Electrodes) -> Array:
        return stretches_along(self, electrodes)

    def along_m(self, arc_m: Array) -> Array:
        return places_along(self, arc_m)

    def path_m(self, first_m: float, last_m: float) -> Array:
        return path_along(self, first_m, last_m)

    def outwards(self, stretches_m: Array) -> Array:
        middle, step = stretches_m.mean(axis=1), 1e-3 * (stretches_m[:, 1] - stretches_m[:, 0])
        along = self.along_m(middle + step) - self.along_m(middle - step)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        return np.column_stack([along[:, 1], -along[:, 0]])

    def check(self, electrodes: Electrodes) -> None:
        check_on_outline(self, electrodes)

    def placed(self, electrodes: Electrodes) -> Electrodes:
        """Lines along it lie at even shares of its length unless their places are given."""
        if not electrodes.along_edge or electrodes.angles_rad or any(getattr(electrodes, name) for name in PLACES):
            return electrodes
        count, way = electrodes.count, -1 if electrodes.clockwise else 1
        return replace(electrodes, shares=tuple(way * k % count / count for k in range(count)), clockwise=False)

    def by_arc(self, electrodes: Electrodes) -> Electrodes:
        return with_positions(self, electrodes) if electrodes.along_edge else electrodes

    def moved(self, electrodes: Electrodes, along_m: Array) -> Electrodes:
        return with_positions(self, electrodes, along_m)

    def turns(self, electrodes: Electrodes) -> int:
        return 1

    @property
    def keys(self) -> dict[str, Any]:
        """What it is in [body] of a scene file, and what is not written there, None."""
        return {"radius_m": None, "outline": self.kind, "width_m": self.width_m, "height_m": self.height_m,
                "corner_radius_m": self.corner_radius_m, "points_m": self.points_m, "holes_m": self.holes_m}


@lru_cache(maxsize=64)
def _loops(outline: Outline) -> tuple[Array, ...]:
    if outline.kind == "rectangle":
        outer = _rectangle(outline.width_m or 0.0, outline.height_m or 0.0, outline.corner_radius_m or 0.0)
    else:
        outer = np.array(outline.points_m, dtype=float).reshape(-1, 2)
    holes = [_hole(hole) for hole in outline.holes_m]
    found = (turned(outer, 1.0), *(turned(hole, -1.0) for hole in holes))
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


def _hole(hole: Point | Loop) -> Array:
    given = np.array(hole, dtype=float)
    return circle(given[:2], given[2]) if given.ndim == 1 else given


def check_keys(kind: str, values: dict[str, Any]) -> None:
    """ValueError where a key of [body] has no effect with such an outline, or one that it needs is missing."""
    for key, name, takers in (("width_mm", "width_m", ("rectangle",)), ("height_mm", "height_m", ("rectangle",)),
                              ("corner_radius_mm", "corner_radius_m", ("rectangle",)),
                              ("points_mm", "points_m", ("polygon",)), ("holes_mm", "holes_m", KINDS)):
        used, given = kind in takers, values[name] not in (None, ())
        instead = " or ".join(f"\"{name}\"" for name in takers)
        _require(used or not given, key, f"has no effect with outline = \"{kind}\"; leave it out, or write outline = "
                 f"{instead}")
        _require(not used or given or key in ("corner_radius_mm", "holes_mm"), key,
                 f"is missing, which outline = \"{kind}\" needs")


@lru_cache(maxsize=64)
def _check_outline(outline: Outline) -> None:
    """ValueError for an outline that crosses itself, and holes that touch it or each other; names the key of [body]."""
    _require(outline.kind in KINDS, "outline", f"'{outline.kind}' is unknown; known: disc, {', '.join(KINDS)}, or in a "
             "scene file the name of a .csv, .dxf, .svg or mesh file")
    check_keys(outline.kind, outline.keys)
    if outline.kind == "rectangle":
        _check_rectangle(outline.width_m or 0.0, outline.height_m or 0.0, outline.corner_radius_m or 0.0)
    for name, points in [("points_mm", outline.points_m)] * (outline.kind == "polygon") + [
            ("holes_mm", hole) for hole in outline.holes_m]:
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
    parts = outline.loops
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


def _require(ok: object, key: str, expected: str) -> None:
    if not ok:
        raise ValueError(f"{key} in [body]: {expected}.")
