"""A rigid punch of any shape, by its signed distance on a grid between which cubic splines run: smooth for Newton."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import NdBSpline, make_interp_spline

from eitsim.scene.surfaces.curved_surface import CurvedSurface
from touchcal.arrays import Array

# Points of the grid over the radius, how far it goes outside the punch's radius and below its lowest point, over that
# radius, and how many distances are found together.
_POINTS, _OUTSIDE, _BELOW, _TOGETHER = 24, 1.15, 0.3, 20_000


@dataclass(frozen=True, eq=False)
class PunchShape:
    """Signed distance to a punch whose lowest point is the origin and whose axis is z, lengths in any one unit."""

    lines: tuple[Array, Array, Array]  # x, y and z of the grid
    inside: Array  # (x, y, z) depth inside the punch, negative outside

    def scaled(self, unit: float) -> "PunchShape":
        """The same, lengths over a unit."""
        return PunchShape((self.lines[0] / unit, self.lines[1] / unit, self.lines[2] / unit), self.inside / unit)

    @cached_property
    def _spline(self) -> NdBSpline:
        knots, values = [], self.inside
        for axis, line in enumerate(self.lines):
            one = make_interp_spline(line, values, k=3, axis=axis)
            knots.append(one.t)
            values = np.moveaxis(one.c, 0, axis) if one.c.shape != values.shape else one.c
        return NdBSpline(tuple(knots), values, 3)

    def penetration(self, points: Array) -> Array:
        """Depth (...) inside the punch of points (..., 3), negative outside; outside the grid that of its nearest
        place less the way there."""
        near = self._on_grid(points)
        return self._spline(near) - np.linalg.norm(points - near, axis=-1)

    def derivatives(self, points: Array) -> tuple[Array, Array]:
        """Gradient (..., 3) and second derivatives (..., 3, 3) of the depth on the grid."""
        near, orders = self._on_grid(points), np.eye(3, dtype=int)
        slope = np.stack([self._spline(near, nu=one) for one in orders], axis=-1)
        bend = np.stack([np.stack([self._spline(near, nu=one + other) for other in orders], axis=-1)
                         for one in orders], axis=-2)
        return slope, bend

    def _on_grid(self, points: Array) -> Array:
        low, high = (np.array([line[end] for line in self.lines]) for end in (0, -1))
        return np.clip(points, low, high)


def punch_shape(surface: CurvedSurface, radius_m: float, height_m: float) -> PunchShape:
    """The shape of a closed surface whose axis is z through the origin, m, up to a height over its lowest point; what
    is sharper than its grid, a twenty-fourth of the radius, is rounded."""
    across = np.linspace(-_OUTSIDE * radius_m, _OUTSIDE * radius_m, int(2 * _OUTSIDE * _POINTS) + 1)
    up = np.linspace(-_BELOW * radius_m, height_m, int((_BELOW + height_m / radius_m) * _POINTS) + 1)
    points = np.stack(np.meshgrid(across, across, up, indexing="ij"), axis=-1)
    lowest = _lowest(surface, radius_m)
    flat = points.reshape(-1, 3) + np.array([0.0, 0.0, lowest])
    parts = []
    for start in range(0, len(flat), _TOGETHER):
        some = flat[start:start + _TOGETHER]
        at, normal = surface.nearest(some)
        parts.append(-np.sign(np.sum((some - at) * normal, axis=1)) * np.linalg.norm(some - at, axis=1))
    return PunchShape((across, across, up), np.concatenate(parts).reshape(points.shape[:3]))


def _lowest(surface: CurvedSurface, radius_m: float) -> float:
    """Height of the surface's lowest place near the axis: that nearest to a place far below."""
    return float(surface.nearest(np.array([[0.0, 0.0, -1e3 * radius_m]]))[0][0, 2])
