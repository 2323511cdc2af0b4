"""A rigid punch of any shape, by its signed distance on a grid between which cubic splines run: smooth for Newton."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import NdBSpline, make_interp_spline

from eitsim.scene.scene import Punch
from eitsim.scene.triangles.punch_files import punch_surface
from eitsim.scene.triangles.solid import Indices, Solid
from touchcal.arrays import Array

# Points of the grid over the radius, how far it goes outside the punch's radius and below its lowest point, over that
# radius, and how many distances are found together.
_POINTS, _OUTSIDE, _BELOW, _TOGETHER = 24, 1.15, 0.3, 20_000
# Longest side of the triangles whose distances are found, over that radius, and how far up the punch is seen, over the
# layer's thickness.
_SIDE, _SEEN = 1 / 12, 1.2


@dataclass(frozen=True, eq=False)
class PunchShape:
    """Signed distance to a punch whose lowest point is the origin and whose axis is z, lengths in any one unit."""

    lines: tuple[Array, Array, Array]  # x, y and z of the grid
    inside: Array  # (x, y, z) depth inside the punch, negative outside

    def scaled(self, unit: float) -> "PunchShape":
        """The same, lengths over a unit."""
        return PunchShape((self.lines[0] / unit, self.lines[1] / unit, self.lines[2] / unit), self.inside / unit)

    @property
    def coarser(self) -> "PunchShape":
        """On every second line of the grid, by which the error of the grid is seen."""
        x, y, z = self.lines
        return PunchShape((x[::2], y[::2], z[::2]), self.inside[::2, ::2, ::2])

    @property
    def height(self) -> float:
        """How far up over its lowest point it is known."""
        return float(self.lines[2][-1])

    @cached_property
    def _spline(self) -> NdBSpline:
        knots, values = [], self.inside
        for axis, line in enumerate(self.lines):
            one = make_interp_spline(line, values, k=3, axis=axis)
            knots.append(one.t)
            values = np.moveaxis(one.c, 0, axis)
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


def shapes_of(punches: Sequence[Punch], thickness_m: float) -> list[PunchShape | None]:
    """The shapes that the punches' files hold, up to where a layer of a thickness, m, can reach; None of those with a
    profile. InputFileError of a file that is no punch; ValueError of one that is wider than the punch says."""
    return [_kept(punch.shape, _stamp(punch.shape), punch.diameter_m / 2, _SEEN * thickness_m) if punch.shape else None
            for punch in punches]


def _stamp(file: str) -> int:
    """When a file was last written; 0 where there is none, which its reader says."""
    return Path(file).stat().st_mtime_ns if Path(file).is_file() else 0


@lru_cache(maxsize=8)
def _kept(file: str, stamp: int, radius_m: float, height_m: float) -> PunchShape:
    nodes, cells = punch_surface(Path(file))
    height = nodes[:, 2] - nodes[:, 2].min()
    widest = float(np.hypot(*nodes[height <= height_m / _SEEN, :2].T).max())
    if widest > radius_m * (1 + 1e-5):
        raise ValueError(f"diameter_mm in [punch]: the part of {Path(file).name} that can touch is {2e3 * widest:.4g} "
                         f"mm wide about its axis, and the punch {2e3 * radius_m:.4g} mm; give that diameter.")
    return punch_shape(nodes, cells, radius_m, min(height_m, float(height.max())))


def punch_shape(nodes_m: Array, cells: Indices, radius_m: float, height_m: float) -> PunchShape:
    """The shape of closed triangles (t, 3) whose axis is z through the origin, m, up to a height over its lowest point;
    what is sharper than its grid, a twenty-fourth of the radius, is rounded."""
    across = np.linspace(-_OUTSIDE * radius_m, _OUTSIDE * radius_m, int(2 * _OUTSIDE * _POINTS) + 1)
    up = np.linspace(-_BELOW * radius_m, height_m, int((_BELOW + height_m / radius_m) * _POINTS) + 1)
    points = np.stack(np.meshgrid(across, across, up, indexing="ij"), axis=-1)
    lowest, solid = float(nodes_m[:, 2].min()), Solid(nodes_m, cells, _SIDE * radius_m)
    flat = points.reshape(-1, 3) + np.array([0.0, 0.0, lowest])
    parts = [solid.distance(flat[start:start + _TOGETHER]) for start in range(0, len(flat), _TOGETHER)]
    return PunchShape((across, across, up), np.concatenate(parts).reshape(points.shape[:3]))
