"""Places of touches on a skin with an outline: uniform where the punch keeps its distance from all edges."""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from eitsim.scene.edges.outline import Outline
from eitsim.scene.polygons import edge_distance_m
from eitsim.scene.scene import Scene, scene_from
from eitsim.simulation.edge_effects import least_gap_m
from touchcal.arrays import Array, Mask

_CELLS = 256  # Cells along the longer side of the outline, in which the distance to the edges is known.
_TABLES = ("body", "skin", "electrodes", "drive", "channels", "accuracy")


@lru_cache(maxsize=8)
def _cells(outline: Outline) -> tuple[Array, Array, float, Array]:
    """Middles (nx,) and (ny,) of square cells about an outline, m, their side, m, and their distance (ny, nx) to the
    nearest edge or hole, m."""
    outer = outline.loops[0]
    low, high = outer.min(axis=0), outer.max(axis=0)
    side = float((high - low).max()) / _CELLS
    x, y = (start + side * (np.arange(math.ceil(reach / side)) + 0.5)
            for start, reach in zip(low, high - low, strict=True))
    rows = [edge_distance_m(outline, np.column_stack([x, np.full(len(x), each)])) for each in y]
    return x, y, side, np.array(rows)


def outlined(tables: Mapping[str, Any]) -> Scene | None:
    """The scene of a row's skin, where it has an outline."""
    if tables.get("body", {}).get("outline", "disc") == "disc":
        return None
    return scene_from({name: tables[name] for name in _TABLES if name in tables})


def on_outline(u: float, v: float, scene: Scene, diameter_mm: float, gap_mm: float | None,
               within_mm: float) -> tuple[float, float]:
    """A place, mm, from two uniform numbers: uniform, by squares of 1/256 of the skin, where the punch's edge keeps
    `gap_mm` from all edges, or where the plan solves it, and lies `within_mm` of the origin; ValueError where there is
    none."""
    x, y, side, distance = _cells(scene.body.outline)
    gap_m = least_gap_m(scene) if gap_mm is None else gap_mm / 1e3
    corner, fits = side / math.sqrt(2), _fitting(scene, diameter_mm, gap_m, within_mm)
    columns = np.cumsum(fits.sum(axis=0), dtype=float)
    if columns[-1] == 0:
        room = float(distance.max() - corner) * 1e3 - diameter_mm / 2
        raise ValueError(f"a punch of diameter_mm = {diameter_mm:g} finds no place that keeps {gap_m * 1e3:.3g} mm "
                         f"from all edges of the skin; the largest gap there is {max(room, 0.0):.3g} mm. Make it "
                         "smaller, ask for less accuracy (a larger signal in [accuracy]), or give gap_mm of place in "
                         "[punch].")
    column, across = _chosen(u, columns)
    row, along = _chosen(v, np.cumsum(fits[:, column], dtype=float))
    return 1e3 * float(x[column] + side * (across - 0.5)), 1e3 * float(y[row] + side * (along - 0.5))


def reached(scene: Scene, diameter_mm: float, within_mm: float) -> tuple[float, float]:
    """How far a punch keeps from all edges where the plan solves it, mm, and the part of the skin where it does."""
    gap_m = least_gap_m(scene)
    fits = _fitting(scene, diameter_mm, gap_m, within_mm)
    return 1e3 * gap_m, float(fits.sum() / np.sum(_cells(scene.body.outline)[3] > 0))


def _fitting(scene: Scene, diameter_mm: float, gap_m: float, within_mm: float) -> Mask:
    """(ny, nx) squares of the skin in which a punch finds room."""
    x, y, side, distance = _cells(scene.body.outline)
    corner = side / math.sqrt(2)
    return (distance >= diameter_mm / 2e3 + gap_m + corner) & (np.hypot(x, y[:, None]) + corner <= within_mm / 1e3)


def _chosen(u: float, cumulative: Array) -> tuple[int, float]:
    """The first cell whose cumulated weight exceeds the share u, and the part of it below."""
    at = u * cumulative[-1]
    k = min(int(np.searchsorted(cumulative, at, side="right")), len(cumulative) - 1)
    before = cumulative[k - 1] if k else 0
    return k, float((at - before) / (cumulative[k] - before))
