"""How touches deform the outer surface of a curved body: a field in space, by coordinates about each group of them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from eitsim.mechanics.general.meshing.layer_layout import ChartLayout
from touchcal.arrays import Array


class ChartField(Protocol):
    """Deformation by coordinates (n, 2), m, along the tangents and the normal there."""

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (n, 3, 3)."""
        ...

    def displacement(self, points_m: Array) -> Array:
        """Displacements (n, 3), m."""
        ...


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Touches that are solved together."""

    layout: ChartLayout
    field: ChartField
    reach_m: float  # distance from the coordinates' origin outside which nothing is deformed


@dataclass(frozen=True, eq=False)
class SpaceField:
    """Deformation of a body's outer surface at its untouched places (n, 3), m; as it was far from all touches."""

    parts: tuple[Neighbourhood, ...]

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (n, 3, 3) along the axes of space."""
        def local(part: Neighbourhood, uv: Array, turn: Array) -> Array:
            return turn @ (part.field.deformation_gradient(uv) - np.eye(3)) @ np.swapaxes(turn, 1, 2)

        return np.eye(3) + self._summed(points_m, local, (3, 3))

    def displacement(self, points_m: Array) -> Array:
        """Displacements (n, 3), m."""
        def local(part: Neighbourhood, uv: Array, turn: Array) -> Array:
            return (turn @ part.field.displacement(uv)[..., None])[..., 0]

        return self._summed(points_m, local, (3,))

    def _summed(self, points_m: Array, local: Callable[[Neighbourhood, Array, Array], Array], shape: tuple[int, ...]
                ) -> Array:
        out = np.zeros((len(points_m), *shape))
        for part in self.parts:
            chart, unit = part.layout.chart, part.layout.unit_m
            near = np.flatnonzero(np.linalg.norm(points_m - chart.place(np.zeros(2))[0], axis=1) < part.reach_m)
            uv = chart.find(points_m[near]) if len(near) else np.empty((0, 2))
            there = np.linalg.norm(uv, axis=1) < part.reach_m  # false where they are not found
            near, uv = near[there], uv[there]
            if len(near):
                out[near] += local(part, uv, part.layout.turn(uv / unit))
        return out
