"""The edge of a disc about the origin, by formulas."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.scene.electrodes import Electrodes, arcs, check, identical, middles
from eitsim.scene.nearest_edge import NearestEdge
from eitsim.scene.polygons import circle
from touchcal.arrays import Array

_CHORDS = 400  # Corners of the polygon that stands for it.


@dataclass(frozen=True)
class Disc:
    """A disc; lengths in m."""

    radius_m: float = 0.1

    name = "the rim"
    is_round = True
    corner = (1.0,)
    grids = ("square", "polar")

    @property
    def table_rim_m(self) -> float:
        return self.radius_m

    @property
    def loops(self) -> tuple[Array, ...]:
        """Corners (n, 2), m, counter-clockwise, of a polygon of its area."""
        return (_polygon(self.radius_m),)

    @property
    def area_m2(self) -> float:
        return np.pi * self.radius_m**2

    @property
    def size_m(self) -> float:
        return self.radius_m

    @property
    def box_m(self) -> tuple[Array, Array]:
        return np.full(2, -self.radius_m), np.full(2, self.radius_m)

    @property
    def moments_m(self) -> tuple[Array, Array]:
        return np.zeros(2), self.radius_m**2 / 4 * np.eye(2)

    def gap_m(self, points_m: ArrayLike) -> Array:
        x, y = np.moveaxis(np.asarray(points_m, dtype=float), -1, 0)
        return self.radius_m - np.hypot(x, y)

    def contains(self, points_m: Array) -> NDArray[np.bool_]:
        return np.linalg.norm(points_m, axis=-1) <= self.radius_m

    def nearest(self, point_m: ArrayLike) -> NearestEdge:
        x, y = np.asarray(point_m, dtype=float).tolist()
        offset = float(np.hypot(x, y))
        towards = np.array([x, y]) / offset if offset else np.array([1.0, 0.0])
        return NearestEdge(self.radius_m, offset, towards, np.full(4, np.inf))

    def inmost_m(self, points_m: Array) -> Array:
        return np.zeros(2)

    def quarters_m(self, point_m: ArrayLike) -> Array:
        return np.array([float(self.gap_m(point_m)), np.inf, np.inf, np.inf])

    def covered_rad(self, place_m: ArrayLike, radius_m: Array) -> Array:
        distance = math.hypot(*np.asarray(place_m, dtype=float).tolist())
        if distance == 0:
            return np.where(radius_m <= self.radius_m, 2 * np.pi, 0.0)
        cosine = (radius_m**2 + distance**2 - self.radius_m**2) / (2 * radius_m * distance)
        return 2 * np.pi - 2 * np.arccos(np.clip(-cosine, -1, 1))

    def stretches_m(self, electrodes: Electrodes) -> Array:
        return self.radius_m * arcs(self.radius_m, electrodes)

    def along_m(self, arc_m: Array) -> Array:
        angle = arc_m / self.radius_m
        return self.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def path_m(self, first_m: float, last_m: float) -> Array:
        return self.along_m(np.linspace(first_m, last_m, 9))

    def outwards(self, stretches_m: Array) -> Array:
        return self.along_m(stretches_m.mean(axis=1)) / self.radius_m

    def check(self, electrodes: Electrodes) -> None:
        check(self.radius_m, electrodes)

    def placed(self, electrodes: Electrodes) -> Electrodes:
        return electrodes

    def by_arc(self, electrodes: Electrodes) -> Electrodes:
        return electrodes

    def moved(self, electrodes: Electrodes, along_m: Array) -> Electrodes:
        return replace(electrodes, angles_rad=tuple(middles(electrodes) + along_m / self.radius_m))

    def turns(self, electrodes: Electrodes) -> int:
        return electrodes.count if identical(electrodes) else 1

    @property
    def keys(self) -> dict[str, Any]:
        """What it is in [body] of a scene file, and what is not written there, None."""
        return {"radius_m": self.radius_m, "outline": None}


@lru_cache(maxsize=64)
def _polygon(radius_m: float) -> Array:
    found = circle(np.zeros(2), radius_m, _CHORDS)
    found.flags.writeable = False
    return found
