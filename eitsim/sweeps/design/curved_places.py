"""Places of touches on a curved skin: uniform by area where the punch keeps its distance from open edges, or listed."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from eitsim.scene.curved.curved_body import CurvedBody, curved_body
from eitsim.scene.curved.curved_scene import placed
from eitsim.scene.scene import Accuracy, Skin
from eitsim.simulation.edge_effects import clear_gap_m
from touchcal.arrays import Array
from touchcal.document import is_number

_CUTS = 8  # Parts of a triangle's side.
_ON_EDGE = 16  # Places of an open edge from which distances are taken.


def on_surface(u: float, v: float, tables: Mapping[str, Any], diameter_mm: float, gap_mm: float | None
               ) -> list[float]:
    """A place of the skin, mm, from two uniform numbers, where the punch's edge keeps `gap_mm` from open edges, or what
    moving touches along a cylinder asks for; ValueError where there is none."""
    body = curved_body(tables["body"], Path())
    if gap_mm is None:
        gap_mm = 1e3 * clear_gap_m(body.thickness_m, tables.get("skin", {}).get("strain", Skin().strain),
                                   tables.get("accuracy", {}).get("signal", Accuracy().signal))
    corners, areas, away = _parts(body)
    fits = np.where(away >= (diameter_mm / 2 + gap_mm) / 1e3, areas, 0.0)
    total = np.cumsum(fits)
    if not total[-1] > 0:
        raise ValueError(f"a punch of diameter_mm = {diameter_mm:g} finds no place that keeps {gap_mm:.3g} mm from the "
                         "ends of the skin; make it smaller, or give a smaller gap_mm of place in [punch].")
    k = int(np.searchsorted(total, u * total[-1], side="right"))
    share = (u * total[-1] - (total[k] - fits[k])) / fits[k]
    one, other = 1 - np.sqrt(share), v * np.sqrt(share)  # uniform on the triangle
    a, b, c = corners[k]
    point = one * a + (1 - one - other) * b + other * c
    return [float(part) for part in 1e3 * body.surface.nearest(point[None])[0][0]]


def at_surface(place: Any, tables: Mapping[str, Any]) -> list[float]:
    """The place of the skin, mm, that is nearest to one of a list; ValueError where it is none."""
    if not (isinstance(place, list) and len(place) == 3 and all(map(is_number, place))):
        raise ValueError(f"at_mm in [punch] must hold x, y and z of a place, or {{choice = [[x, y, z], ...]}} or "
                         f"{{list = [[x, y, z], ...]}}, got {place!r:.80}.")
    (near,) = placed(curved_body(tables["body"], Path()), np.array([place], dtype=float) / 1e3, "punch")
    return [float(part) for part in 1e3 * near]


@lru_cache(maxsize=8)
def _parts(body: CurvedBody) -> tuple[Array, Array, Array]:
    """Small triangles (n, 3, 3) of the skin, m, their areas (n,), m^2, and the least distance (n,), m, of their corners
    from open edges."""
    cells, nodes = body.triangles.cells[:, :3], body.triangles.nodes_m
    grid = [(i, j) for i in range(_CUTS) for j in range(_CUTS - i)]
    up = [((i, j), (i + 1, j), (i, j + 1)) for i, j in grid]
    down = [((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i, j in grid if i + j < _CUTS - 1]
    share = np.array(up + down) / _CUTS
    weight = np.concatenate([1 - share.sum(axis=-1, keepdims=True), share], axis=-1)
    corners = np.einsum("pck,tkx->tpcx", weight, nodes[cells]).reshape(-1, 3, 3)
    a, b, c = np.moveaxis(corners, 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    sides = np.sort(np.vstack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1)
    pairs, times = np.unique(sides, axis=0, return_counts=True)
    if not np.any(times == 1):
        return corners, areas, np.full(len(corners), np.inf)
    one, other = np.moveaxis(nodes[pairs[times == 1]], 1, 0)
    along = np.linspace(0, 1, _ON_EDGE)[:, None, None]
    tree = KDTree(((1 - along) * one + along * other).reshape(-1, 3))
    return corners, areas, tree.query(corners.reshape(-1, 3))[0].reshape(-1, 3).min(axis=1)
