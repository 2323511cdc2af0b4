"""How a layer that is meshed flat lies in space: each place of its surface, with the layer along the normal below it.

Lengths in thicknesses.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from eitsim.scene.surfaces.curved_surface import CROSS, Chart, Coordinates, frames, second_form
from eitsim.scene.surfaces.geodesic_arcs import arcs
from touchcal.arrays import Array

# Steps of the differences for tangents, and for a surface's curvatures under a punch: over so much it is averaged.
_STEP, _CURVING = 1e-4, 0.3


class Layout(Coordinates, Protocol):
    """A surface by two coordinates, and its directions."""

    def turn(self, uv: Array) -> Array:
        """Rotations (..., 3, 3): in columns two tangents and the normal, nearest to the lines of coordinates."""
        ...


@dataclass(frozen=True, eq=False)
class Cap:
    """A sphere of a curvature, positive where convex, by lengths and directions from a place; a plane where it is 0."""

    curvature: float = 0.0
    centre: tuple[float, float] = (0.0, 0.0)

    def place(self, uv: Array) -> tuple[Array, Array]:
        """As of `Layout`."""
        at, normal = arcs(uv - np.array(self.centre), self.curvature * np.eye(2))
        return at + np.array([*self.centre, 0.0]), normal

    def turn(self, uv: Array) -> Array:
        """As of `Layout`."""
        if self.curvature == 0:
            return np.broadcast_to(np.eye(3), (*uv.shape[:-1], 3, 3))
        return frames(self, uv, _STEP)


@dataclass(frozen=True, eq=False)
class ChartLayout:
    """Coordinates of a body's surface."""

    chart: Chart  # lengths in m
    unit_m: float  # the thickness

    def place(self, uv: Array) -> tuple[Array, Array]:
        """As of `Layout`."""
        at, normal = self.chart.place(uv * self.unit_m)
        return at / self.unit_m, normal

    def turn(self, uv: Array) -> Array:
        """As of `Layout`."""
        return frames(self, uv, _STEP)


FLAT = Cap()


def in_space(layout: Layout, coordinates: Array) -> Array:
    """Points (n, 3) of the layer at two coordinates and a height (n, 3) below the surface, negative."""
    at, normal = layout.place(coordinates[:, :2])
    return at + coordinates[:, 2:] * normal


def curvatures(layout: Layout, uv: Array) -> tuple[float, float]:
    """The lesser and the larger principal curvature at coordinates (2,), positive where convex."""
    if layout is FLAT:
        return 0.0, 0.0
    at, normal = layout.place(uv + _CURVING * CROSS)
    low, high = np.linalg.eigvalsh(second_form(at, normal, layout.place(uv)[1])).tolist()
    return low, high
