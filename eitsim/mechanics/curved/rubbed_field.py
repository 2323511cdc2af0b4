"""The field of touches on a curved body, with what friction adds to each alone on a flat layer."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.general.friction_alone import Rubbed
from eitsim.scene.results import SpaceField, Touch
from eitsim.scene.scene import Punch
from eitsim.scene.surfaces.curved_surface import Chart, CurvedSurface
from eitsim.scene.triangle_files import Indices
from eitsim.sheet.sheet_conductance import surface_metric
from eitsim.sheet.sheet_displacement import displacement
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class RubbedSpaceField:
    """Stretches of lone flat touches with friction over those without, by coordinates about each place, multiply those
    of a field; displacements add up."""

    smooth: SpaceField
    rubbed: tuple[tuple[Chart, Rubbed], ...]

    def deformation_gradient(self, points_m: Array) -> Array:
        """As of `SpaceField`."""
        f = self.smooth.deformation_gradient(points_m)
        for chart, each in self.rubbed:
            near, uv = _near(chart, each, points_m)
            frames = tangents(chart, uv)
            rough, smooth = (_stretch(uv, each.punch, touch) for touch in (each.rough, each.smooth))
            f[near] = f[near] @ frames @ np.linalg.solve(smooth, rough) @ np.swapaxes(frames, 1, 2)
        return f

    def displacement(self, points_m: Array) -> Array:
        """As of `SpaceField`."""
        out = self.smooth.displacement(points_m)
        for chart, each in self.rubbed:
            near, uv = _near(chart, each, points_m)
            added = displacement(uv, each.punch, each.rough) - displacement(uv, each.punch, each.smooth)
            out[near] += (tangents(chart, uv) @ added[..., None])[..., 0]
        return out


def _near(chart: Chart, each: Rubbed, points_m: Array) -> tuple[Indices, Array]:
    """Numbers of points within the reach of the lone touches, and their coordinates (n, 2)."""
    reach = min(each.rough.radius_m[-1], chart.limit_m)
    near = np.flatnonzero(np.linalg.norm(points_m - chart.place(np.zeros(2))[0], axis=1) < reach)
    uv = chart.find(points_m[near])
    there = np.linalg.norm(uv, axis=1) < reach
    return near[there], uv[there]


def _stretch(uv: Array, punch: Punch, touch: Touch) -> Array:
    """Stretches (n, 3, 3) of a flat touch along the axes of its plane and its normal."""
    metric, normal = surface_metric(uv, punch, touch)
    squared, axes = np.linalg.eigh(metric)
    out = np.zeros((len(uv), 3, 3))
    out[:, :2, :2] = np.einsum("nij,nj,nkj->nik", axes, np.sqrt(squared), axes)
    out[:, 2, 2] = normal
    return out


def tangents(chart: Chart, uv: Array) -> Array:
    """Frames (n, 3, 3) at coordinates: the first tangent of the origin turned into the surface there, the second, and
    the normal, in columns."""
    normal = chart.place(uv)[1]
    first: Array = chart.frame[0] - (normal @ chart.frame[0])[:, None] * normal
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    second: Array = np.cross(normal, first)
    return np.stack([first, second, normal], axis=-1)


def with_friction(smooth: SpaceField, rubbed: Sequence[tuple[int, Rubbed]], surface: CurvedSurface, places_m: Array
                  ) -> SpaceField:
    """The field with what friction adds to some touches, by their numbers."""
    if not rubbed:
        return smooth
    return RubbedSpaceField(smooth, tuple((surface.chart_about(places_m[k]), each) for k, each in rubbed))
