"""A skin with an outline as a surrogate needs it: its edges, and the fields of its electrodes as sums over poles.

The potential of an electrode is the real part of a function f that is analytic on the skin. By Cauchy's formula f' is
an integral of 1 / (w - z) along the edges; far enough from these a sum over few places w on them is as exact. Its
coefficients are those that give f' best along a line within the skin, where it follows from the potentials along the
edges (`eitsim.electrics.outline.edge_response`): by the maximum principle f' errs less on the skin inside that line.
"""

import math
from dataclasses import dataclass

import numpy as np

from eitsim.electrics.outline.adapted_mesh import READINGS, solve_untouched
from eitsim.electrics.outline.edge_response import EdgeResponse, arriving, edge_responses
from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import middles_m
from eitsim.scene.electrodes import contact_impedances, widths
from eitsim.scene.polygons import corners_and_edges, edge_distance_m, inside, squared_distance
from eitsim.scene.scene import Electrodes
from touchcal.arrays import Array, Complex

# The line along which f' is matched lies so far from the edges, over the largest distance that a place has from them,
# or so far over the least distance of a touch; poles on the edges and places on the line have steps of these parts of
# that. There are so many poles at most, about: the line lies farther from the edges then.
LINE, BEFORE, POLES, MATCHED, MOST_POLES = 0.1, 0.5, 0.4, 0.2, 1000
_GRID, _SHRINKS = 80, 40  # places along each axis from which the innermost one is sought, and steps from the best
_RELATIVE = 1e-10  # part of the largest singular value of the poles' fields below which one is left out
_BATCH = 256  # places whose fields are integrated together


@dataclass(frozen=True, eq=False)
class Sheet:
    """Edges and electrodes of a skin, and f of its electrodes by 1 A, times pi over the sheet's resistance: without a
    unit, as the power series of the disc."""

    start_mm: Array  # (edges, 2) starts of the edges, the skin on their left
    end_mm: Array  # (edges, 2) their ends
    electrode: Array  # (electrodes, 4) x, y of the middles and width, mm, contact impedance, Ohm m
    origin_mm: Array  # (2,) place farthest from the edges
    line_mm: float  # distance of the line along which f' is matched to the edges; nearer to these it errs
    # (poles,) places w on the edges, from the origin over its distance to the edges; none of electrodes on the surface
    pole: Complex
    strength: Complex  # (poles, electrodes) f' = sum_w strength / (w - z)
    potential: Array  # (electrodes, electrodes) potentials of the electrodes, columns by the driven one

    @property
    def on_surface(self) -> bool:
        """Whether the electrodes lie on the surface, and have no fields by poles."""
        return not self.pole.size


def sheet_of(outline: Outline, electrodes: Electrodes, conductance_S: float,
             places_m: Array | None = None) -> tuple[Sheet, float]:
    """A skin of sheet conductance S, S, with fields that are exact at places (n, 2), and the distance of its innermost
    place to its edges, mm. Electrodes on the surface have no such fields: they are no sums over poles on the edges."""
    origin, reach = innermost_m(outline)
    start, end = corners_and_edges(outline)
    along_edge = electrodes.along_edge
    pole, strength, away = (_poles(outline, electrodes, conductance_S, (origin, reach), places_m) if along_edge else
                            (np.zeros(0, np.complex128), np.zeros((0, electrodes.count), np.complex128), 0.0))
    impedance = solve_untouched(outline, electrodes, conductance_S, READINGS).impedance_Ohm
    described = np.column_stack([1e3 * middles_m(outline, electrodes), 1e3 * widths(electrodes),
                                 contact_impedances(electrodes)])
    return Sheet(1e3 * start, 1e3 * end, described, 1e3 * origin, 1e3 * away, pole, strength,
                 np.pi * conductance_S * impedance), 1e3 * reach


def _poles(outline: Outline, electrodes: Electrodes, conductance_S: float, innermost: tuple[Array, float],
           places_m: Array | None) -> tuple[Complex, Complex, float]:
    """Poles, their strengths, and the distance of the line to the edges, m."""
    (origin, reach), (start, end) = innermost, corners_and_edges(outline)
    away = LINE * reach
    if places_m is not None and len(places_m):
        away = min(away, BEFORE * float(np.min(edge_distance_m(outline, places_m))))
    away = max(away, float(np.linalg.norm(end - start, axis=1).sum()) / MOST_POLES / POLES)
    pole, line = _along(start, end, POLES * away), _offset(outline, away, MATCHED * away)
    response = edge_responses(outline, electrodes, conductance_S)[0]
    field = np.concatenate([first_derivative(response, part, reach) for part in np.array_split(
        line, len(line) // _BATCH + 1)])
    centre = complex(*origin)
    pole, line = (pole - centre) / reach, (line - centre) / reach
    basis = 1 / (pole - line[:, None])
    return pole, np.asarray(np.linalg.lstsq(basis, field, rcond=_RELATIVE)[0], np.complex128), away


def first_derivative(response: EdgeResponse, place_m: Complex, scale_m: float) -> Complex:
    """(n, electrodes) pi S f' at places (n,) of a skin, by its edges, lengths over a scale."""
    found = arriving(response, [(complex(one), scale_m) for one in place_m], 1)
    return np.pi * response.conductance_S * found


def fields(sheet: Sheet, z: Complex, orders: int) -> Complex:
    """(orders, n, electrodes) derivatives 1 ... orders of f at z (n,), from the origin over its distance to the
    edges."""
    kernel = 1 / (sheet.pole - z[:, None])
    power, found = np.ones_like(kernel), np.empty((orders, len(z), sheet.strength.shape[1]), complex)
    for k in range(orders):
        power = power * kernel
        found[k] = math.factorial(k) * (power @ sheet.strength)
    return found


def edge_distance_mm(sheet: Sheet, place_mm: Array) -> tuple[Array, Array]:
    """Distances (n,) of places (n, 2) to the nearest edge, negative outside the skin, and their slopes (n, 2)."""
    square = squared_distance(place_mm[:, None], sheet.start_mm, sheet.end_mm)
    nearest = square.argmin(axis=1)
    start, along = sheet.start_mm[nearest], (sheet.end_mm - sheet.start_mm)[nearest]
    way = np.clip(np.sum((place_mm - start) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    off, away = place_mm - start - way[:, None] * along, np.sqrt(square.min(axis=1))
    sign = np.where(inside(place_mm, sheet.start_mm, sheet.end_mm), 1.0, -1.0)
    return sign * away, sign[:, None] * off / np.maximum(away, 1e-12)[:, None]


def same_sheet(one: Sheet | None, other: Sheet | None) -> bool:
    """Whether two skins have the same edges and electrodes; two discs have none."""
    if one is None or other is None:
        return one is other
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("start_mm", "end_mm", "electrode"))


def innermost_m(outline: Outline) -> tuple[Array, float]:
    """The place (2,) farthest from all edges, m, and that distance: the best of a grid, then of ever smaller steps."""
    start, _ = corners_and_edges(outline)
    low, high = start.min(axis=0), start.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, _GRID).T), axis=-1).reshape(-1, 2)
    distance = edge_distance_m(outline, grid)
    best, far = grid[distance.argmax()], float(distance.max())
    step = float((high - low).max()) / _GRID
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    for _ in range(_SHRINKS):
        tried = best + step * np.column_stack([np.cos(turn), np.sin(turn)])
        distance = edge_distance_m(outline, tried)
        if distance.max() > far:
            best, far = tried[distance.argmax()], float(distance.max())
        else:
            step /= 2
    return best, far


def _along(start: Array, end: Array, step_m: float) -> Complex:
    """Places (k,) on edges at about even steps, m, none on a corner."""
    parts = []
    for a, b in zip(start, end, strict=True):
        count = math.ceil(float(np.linalg.norm(b - a)) / step_m)
        parts.append(a + (b - a) * ((np.arange(count) + 0.5) / count)[:, None])
    points = np.concatenate(parts)
    return points[:, 0] + 1j * points[:, 1]


def _offset(outline: Outline, away_m: float, step_m: float) -> Complex:
    """Places (k,) of a skin at a distance, m, from its edges, at about even steps, m; about corners that point inwards
    on arcs."""
    start, end = corners_and_edges(outline)
    count = max(8, math.ceil(2 * np.pi * away_m / step_m))
    turn = 2 * np.pi * np.arange(count) / count
    arc = (start[:, None] + away_m * np.column_stack([np.cos(turn), np.sin(turn)])).reshape(-1, 2)
    straight = []
    for a, b in zip(start, end, strict=True):
        length = float(np.linalg.norm(b - a))
        inwards = np.array([a[1] - b[1], b[0] - a[0]]) / length
        share = np.linspace(0, 1, math.ceil(length / step_m) + 1)
        straight.append(a + (b - a) * share[:, None] + away_m * inwards)
    points = np.concatenate([arc, *straight])
    kept = edge_distance_m(outline, points) > (1 - 1e-6) * away_m
    return points[kept, 0] + 1j * points[kept, 1]
