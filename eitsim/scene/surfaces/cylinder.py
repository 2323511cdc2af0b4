"""A cylinder about the x axis, unrolled: exact."""

import math
from dataclasses import dataclass

import numpy as np

from eitsim.scene.edges.outline import Outline
from eitsim.scene.surfaces.curved_surface import tangent_frame
from touchcal.arrays import Array

_ROUND = 0.95  # Part of half a turn to which coordinates reach.


@dataclass(frozen=True)
class Cylinder:
    """The side of a cylinder about the x axis, its middle at the origin; its top at z = radius."""

    radius_m: float
    length_m: float

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """As of `CurvedSurface`."""
        away = np.linalg.norm(points[..., 1:], axis=-1, keepdims=True)
        normal = np.where(away > 0, points[..., 1:] / np.where(away > 0, away, 1.0), [0.0, 1.0])
        along = np.clip(points[..., :1], -self.length_m / 2, self.length_m / 2)
        return (np.concatenate([along, self.radius_m * normal], axis=-1),
                np.concatenate([np.zeros_like(along), normal], axis=-1))

    def chart_about(self, point: Array) -> "CylinderChart":
        """As of `CurvedSurface`."""
        (at,), (normal,) = self.nearest(np.asarray(point)[None])
        return CylinderChart(self, float(at[0]), tangent_frame(normal))


@dataclass(frozen=True, eq=False)
class CylinderChart:
    """Length along the axis, and along the circle about it."""

    cylinder: Cylinder
    middle_m: float  # x of the origin
    frame: Array  # as of `Chart`
    ball_m = open_m = None

    @property
    def edge(self) -> Outline:
        """Both ends, and nearly half a turn each way."""
        half, turn = self.cylinder.length_m / 2, self.limit_m
        low, high = -half - self.middle_m, half - self.middle_m
        return Outline("polygon", points_m=((low, -turn), (high, -turn), (high, turn), (low, turn)))

    @property
    def limit_m(self) -> float:
        """As of `Chart`."""
        return _ROUND * math.pi * self.cylinder.radius_m

    def place(self, uv: Array) -> tuple[Array, Array]:
        """As of `Chart`."""
        angle = uv[..., 1:] / self.cylinder.radius_m
        normal = np.sin(angle) * self.frame[1] + np.cos(angle) * self.frame[2]
        return (self.middle_m + uv[..., :1]) * np.array([1.0, 0.0, 0.0]) + self.cylinder.radius_m * normal, normal

    def find(self, points: Array) -> Array:
        """As of `Chart`."""
        angle = np.arctan2(points @ self.frame[1], points @ self.frame[2])
        return np.column_stack([points[:, 0] - self.middle_m, self.cylinder.radius_m * angle])
