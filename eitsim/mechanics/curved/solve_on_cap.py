"""One upright punch on a layer about a ball: axisymmetric, on the mesh of the meridian bent onto the cap."""

from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.indentation import first_touch
from eitsim.mechanics.axisymmetric.solve_axisymmetric import (
    at_depth,
    force_unit,
    mesh_hierarchy,
    rubbed,
    rubbed_course,
    touch_of,
    under_force,
)
from eitsim.mechanics.contact import friction
from eitsim.mechanics.general.layer.lone_touches import LoneSurface, LoneTouch, lone_surface
from eitsim.mechanics.solid.grid import default_element_m, feature_m
from eitsim.scene.edges.disc import Disc
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, profile_of
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import cpu_s

# Radius of the layer that is solved, thicknesses outside the punch's edge, and at most so far about the ball, rad.
_ENDLESS, _ROUND = 6.0, 0.8 * np.pi


@dataclass(frozen=True, eq=False)
class CapField:
    """An axisymmetric touch by the cap's coordinates about its axis, vectors along the tangents and the normal."""

    surface: LoneSurface
    unit_m: float

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (n, 3, 3) at places (n, 2), m."""
        return np.eye(3) + self.surface.gradient(points_m / self.unit_m)

    def displacement(self, points_m: Array) -> Array:
        """Displacements (n, 3), m, at places (n, 2), m."""
        return self.surface.displacement(points_m / self.unit_m) * self.unit_m


def solve_on_cap(law: Law, thickness_m: float, punch: Punch, curvature_per_m: float, *, finer: bool = False
                 ) -> tuple[Touch, CapField]:
    """Equilibrium of a layer of a thickness, m, whose outer surface has a curvature, 1/m, positive where convex, under
    a punch along the normal; depths count from first touch. finer: on elements of half the default size. ValueError
    where the layer does not fit on the ball, NotConverged where no equilibrium is found."""
    started, reach = cpu_s(), punch.diameter_m / 2 + _ENDLESS * thickness_m
    body = Body(Disc(min(reach, _ROUND / max(abs(curvature_per_m), 1e-300))), thickness_m)
    smooth, shear_limit = replace(punch, friction="none"), friction.coefficient(punch)
    rounded = replace(smooth, fillet_m=profile_of(punch).edge_radius)
    element_m = default_element_m(body, rounded) / (2 if finer else 1)
    levels = mesh_hierarchy(law, body, smooth, element_m, None, curvature_per_m=curvature_per_m)
    first = first_touch(levels[-1])
    force = None if punch.force_N is None else punch.force_N / force_unit(law, body)
    depth = (punch.depth_m or 0.0) / thickness_m + first
    if shear_limit == 0:
        states = at_depth(levels, depth) if force is None else under_force(levels, force)
        touch = touch_of(law, body, levels, states, started)
    else:
        course = rubbed_course(levels, shear_limit, force, depth)
        touch, states = rubbed(law, body, levels, course, started), [course.fine.state]
    lone = LoneTouch(levels[-1], states[-1], feature_m(body, rounded) / thickness_m, curvature_per_m * thickness_m)
    return (replace(touch, depth_m=touch.depth_m - first * thickness_m, section=None),
            CapField(lone_surface(lone), thickness_m))
