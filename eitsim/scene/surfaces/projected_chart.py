"""Coordinates of any smooth surface: arcs of the curvatures at the origin, taken to the nearest place of the surface.

The arcs leave the surface with the third power of their length, and so do lengths of the coordinates. They are found
back by Newton's method.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.edges.disc import Disc
from eitsim.scene.surfaces.curved_surface import CROSS, CurvedSurface, second_form
from eitsim.scene.surfaces.geodesic_arcs import arcs
from touchcal.arrays import Array

# Newton steps back to coordinates, and in lengths of the surface the longest of them, the last, that of differences and
# the largest miss.
_STEPS, _LONGEST, _DONE, _STEP, _MISS = 12, 0.2, 1e-9, 1e-5, 1e-4


@dataclass(frozen=True, eq=False)
class ProjectedChart:
    """Arcs from a place, projected."""

    surface: CurvedSurface
    origin: Array  # (3,)
    frame: Array  # as of `Chart`
    form: Array  # (2, 2) second fundamental form at the origin, 1/m
    limit_m: float  # as of `Chart`
    length_m: float  # of the surface, by which steps are measured
    open_m: Array | None = None  # as of `Chart`
    ball_m = None

    @property
    def edge(self) -> Disc:
        """Where the coordinates end."""
        return Disc(self.limit_m)

    def place(self, uv: Array) -> tuple[Array, Array]:
        """As of `Chart`."""
        away, _ = arcs(uv, self.form)
        at, normal = self.surface.nearest((self.origin + away @ self.frame).reshape(-1, 3))
        return at.reshape(away.shape), normal.reshape(away.shape)

    def find(self, points: Array) -> Array:
        """As of `Chart`."""
        points, step = self.surface.nearest(points)[0], _STEP * self.length_m
        uv, off = (points - self.origin) @ self.frame[:2].T, np.arange(len(points))
        for _ in range(_STEPS):
            at = uv[off]
            along = np.stack([(self.place(at + d)[0] - self.place(at - d)[0]) / (2 * step) for d in step * np.eye(2)],
                             axis=-1)
            missing = points[off] - self.place(at)[0]
            metric = np.swapaxes(along, 1, 2) @ along + 1e-12 * np.eye(2)
            change = np.linalg.solve(metric, np.swapaxes(along, 1, 2) @ missing[..., None])[..., 0]
            size = np.linalg.norm(change, axis=1)
            uv[off] += change * np.minimum(1.0, _LONGEST * self.length_m / np.maximum(size, 1e-300))[:, None]
            off = off[size >= _DONE * self.length_m]
            if not off.size:
                break
        missed = np.linalg.norm(points - self.place(uv)[0], axis=1) > _MISS * self.length_m
        return np.where(missed[:, None], np.nan, uv)


def form_at(surface: CurvedSurface, origin: Array, frame: Array, step_m: float) -> Array:
    """Second fundamental form (2, 2), 1/m, of a surface at its place (3,), positive where convex, by differences."""
    at, normal = surface.nearest(origin + step_m * CROSS @ frame[:2])
    return second_form(at, normal, frame[2])
