"""Coordinates of any smooth surface: arcs of the curvatures at the origin, taken to the nearest place of the surface.

The arcs leave the surface with the third power of their length, and so do lengths of the coordinates. They are found
back by Newton's method.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eitsim.scene.edges.edge import Edge
from eitsim.scene.surfaces.arcs import arcs
from eitsim.scene.surfaces.surface import CROSS, CurvedSurface, second_form
from touchcal.arrays import Array

# Newton steps back to coordinates, the step of their differences and the largest miss, in lengths of the surface.
_STEPS, _STEP, _MISS = 12, 1e-5, 1e-6


@dataclass(frozen=True, eq=False)
class ProjectedChart:
    """Arcs from a place, projected."""

    surface: CurvedSurface
    origin: Array  # (3,)
    frame: Array  # as of `Chart`
    form: Array  # (2, 2) second fundamental form at the origin, 1/m
    edge: Edge  # as of `Chart`
    length_m: float  # of the surface, by which steps are measured

    def place(self, uv: Array) -> tuple[Array, Array]:
        """As of `Chart`."""
        away, _ = arcs(uv, self.form)
        at, normal = self.surface.nearest((self.origin + away @ self.frame).reshape(-1, 3))
        return at.reshape(away.shape), normal.reshape(away.shape)

    def find(self, points: Array) -> Array:
        """As of `Chart`."""
        uv, step = (points - self.origin) @ self.frame[:2].T, _STEP * self.length_m
        for _ in range(_STEPS):
            along = np.stack([(self.place(uv + d)[0] - self.place(uv - d)[0]) / (2 * step) for d in step * np.eye(2)],
                             axis=-1)
            missing = points - self.place(uv)[0]
            metric = np.swapaxes(along, 1, 2) @ along + 1e-12 * np.eye(2)
            change = np.linalg.solve(metric, np.swapaxes(along, 1, 2) @ missing[..., None])[..., 0]
            size = np.linalg.norm(change, axis=1, keepdims=True)
            uv = uv + change * np.minimum(1.0, self._longest / np.maximum(size, 1e-300))
        missed = np.linalg.norm(points - self.place(uv)[0], axis=1) > _MISS * self.length_m
        return np.where(missed[:, None], np.nan, uv)

    @cached_property
    def _longest(self) -> float:
        return 0.2 * self.length_m


def form_at(surface: CurvedSurface, origin: Array, frame: Array, step_m: float) -> Array:
    """Second fundamental form (2, 2), 1/m, of a surface at its place (3,), positive where convex, by differences."""
    at, normal = surface.nearest(origin + step_m * CROSS @ frame[:2])
    return second_form(at, normal, frame[2])
