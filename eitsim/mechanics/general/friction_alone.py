"""Friction of touches that are solved together without it: what it changes of each alone is added.

What friction changes of the effect of edges and neighbours is left out (benchmarks/friction_alone.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.results import SurfaceField, Touch
from eitsim.scene.scene import Body, Punch
from eitsim.sheet.sheet_conductance import surface_metric
from eitsim.sheet.sheet_displacement import displacement
from matcal.laws.law import Law
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class Rubbed:
    """A lone touch with friction, and without."""

    punch: Punch
    rough: Touch
    smooth: Touch


@dataclass(frozen=True, eq=False)
class RubbedField:
    """The field of touches without friction, and what friction adds to each alone."""

    smooth: SurfaceField
    rubbed: tuple[Rubbed, ...]

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        """In-plane metric (..., 2, 2), whose changes add up, and normal stretch (...), whose factors multiply."""
        metric, normal = self.smooth.metric(points_m)
        for each in self.rubbed:
            (rough, rough_normal), (smooth, smooth_normal) = (
                surface_metric(points_m, each.punch, touch) for touch in (each.rough, each.smooth))
            metric, normal = metric + rough - smooth, normal * rough_normal / smooth_normal
        return metric, normal

    def displacement(self, points_m: Array) -> Array:
        """Displacement (n, 3), m, at points (n, 2), m."""
        return self.smooth.displacement(points_m) + np.sum([
            displacement(points_m, each.punch, each.rough) - displacement(points_m, each.punch, each.smooth)
            for each in self.rubbed], axis=0)


def with_friction(touches: Sequence[Touch], law: Law, body: Body, punches: Sequence[Punch]) -> tuple[Touch, ...]:
    """Touches solved together without friction, with what the friction of their punches changes of each alone.

    NotConverged where a lone touch with friction has no equilibrium.
    """
    lone = [None if punch.friction == "none" else Rubbed(
        punch, solve_touch(law, body, punch), solve_touch(law, body, replace(punch, friction="none")))
        for punch in punches]
    rubbed = tuple(each for each in lone if each is not None)
    if not rubbed:
        return tuple(touches)
    smooth = touches[0].surface
    assert smooth is not None, "touches that are solved together share a field"
    field = RubbedField(smooth, rubbed)
    return tuple(replace(touch if each is None else rubbed_touch(touch, each), surface=field)
                 for touch, each in zip(touches, lone, strict=True))


def rubbed_touch(touch: Touch, lone: Rubbed) -> Touch:
    """One touch with the lone one's changes: of the depth, or of the force at a given depth, in proportion."""
    rough, smooth = lone.rough, lone.smooth

    def grown(name: str) -> float:
        return getattr(touch, name) * getattr(rough, name) / getattr(smooth, name)

    return replace(
        touch, force_N=grown("force_N"), depth_m=grown("depth_m"), sigma_max_Pa=grown("sigma_max_Pa"),
        sigma_ave_Pa=grown("sigma_ave_Pa"), contact_area_m2=grown("contact_area_m2"),
        depth_error=touch.depth_error + rough.depth_error, signal_errors=touch.signal_errors + rough.signal_errors,
        iterations=touch.iterations + rough.iterations, cpu_s=touch.cpu_s + rough.cpu_s + smooth.cpu_s,
        slip_fraction=rough.slip_fraction)
