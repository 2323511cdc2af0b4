"""A quadratic surface z = -(x^2/a + y^2/b)/2 with its apex at the origin: a saddle where a and b differ in sign."""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.surfaces.curved_surface import tangent_frame
from eitsim.scene.surfaces.projected_chart import ProjectedChart, form_at
from touchcal.arrays import Array

# Newton steps to the nearest place; over the lesser radius the last one, the step of differences, and the length to
# which coordinates reach.
_STEPS, _DONE, _STEP, _REACH = 60, 1e-13, 1e-4, 1.4
_LEAST = 0.2  # Least stiffness of such a step: that of distance along a tangent falls to none at a centre of curvature.


@dataclass(frozen=True)
class Saddle:
    """Radii of curvature at the apex along x and y, m, positive where convex, and the outward side up."""

    radius_x_m: float
    radius_y_m: float

    @property
    def length_m(self) -> float:
        """The lesser radius."""
        return min(abs(self.radius_x_m), abs(self.radius_y_m))

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """As of `CurvedSurface`, by Newton's method: right near the surface."""
        bend = 1 / np.array([self.radius_x_m, self.radius_y_m])
        flat, up = points[..., :2], points[..., 2:]
        at = flat
        for _ in range(_STEPS):
            slope, off = -bend * at, -(bend * at**2).sum(axis=-1, keepdims=True) / 2 - up
            gradient = at - flat + off * slope
            stiff = np.maximum(1 - off * bend, _LEAST)[..., None] * np.eye(2)
            hessian = slope[..., :, None] * slope[..., None, :] + stiff
            step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
            at = at - step
            if np.abs(step).max(initial=0.0) < _DONE * self.length_m:
                break
        normal = np.concatenate([bend * at, np.ones_like(up)], axis=-1)
        return (np.concatenate([at, -(bend * at**2).sum(axis=-1, keepdims=True) / 2], axis=-1),
                normal / np.linalg.norm(normal, axis=-1, keepdims=True))

    def chart_about(self, point: Array) -> ProjectedChart:
        """As of `CurvedSurface`."""
        (origin,), (normal,) = self.nearest(np.asarray(point, dtype=float)[None])
        frame = tangent_frame(normal)
        form = form_at(self, origin, frame, _STEP * self.length_m)
        return ProjectedChart(self, origin, frame, form, _REACH * self.length_m, self.length_m)
