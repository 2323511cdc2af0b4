"""A sphere about the origin of coordinates, laid out by its exponential map: exact."""

import math
from dataclasses import dataclass

import numpy as np

from eitsim.scene.edges.disc import Disc
from eitsim.scene.surfaces.curved_surface import tangent_frame
from eitsim.scene.surfaces.geodesic_arcs import arcs
from touchcal.arrays import Array

_ROUND = 0.95  # Part of half a turn to which coordinates reach.


@dataclass(frozen=True)
class Sphere:
    """A sphere about the origin; its top at z = radius."""

    radius_m: float

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """As of `CurvedSurface`."""
        away = np.linalg.norm(points, axis=-1, keepdims=True)
        normal = np.where(away > 0, points / np.where(away > 0, away, 1.0), [0.0, 0.0, 1.0])
        return self.radius_m * normal, normal

    def chart_about(self, point: Array) -> "SphereChart":
        """As of `CurvedSurface`."""
        return SphereChart(self.radius_m, tangent_frame(self.nearest(np.asarray(point)[None])[1][0]))


@dataclass(frozen=True, eq=False)
class SphereChart:
    """Lengths and directions of great circles from a place."""

    radius_m: float
    frame: Array  # as of `Chart`
    open_m = None

    @property
    def edge(self) -> Disc:
        """Nearly the whole sphere."""
        return Disc(self.limit_m)

    @property
    def limit_m(self) -> float:
        """As of `Chart`."""
        return _ROUND * math.pi * self.radius_m

    @property
    def ball_m(self) -> float:
        """As of `Chart`."""
        return self.radius_m

    def place(self, uv: Array) -> tuple[Array, Array]:
        """As of `Chart`."""
        _, normal = arcs(uv, np.eye(2) / self.radius_m)
        normal = normal @ self.frame
        return self.radius_m * normal, normal

    def find(self, points: Array) -> Array:
        """As of `Chart`."""
        seen = points @ self.frame.T
        flat = np.hypot(seen[:, 0], seen[:, 1])
        share = np.arctan2(flat, seen[:, 2]) / np.where(flat > 0, flat, 1.0)
        return self.radius_m * share[:, None] * seen[:, :2]
