"""What the rim, or a neighbour, changes of an axisymmetric touch, and how well that is known."""

import math
from dataclasses import dataclass, replace

import numpy as np

from eitsim.scene.polygons import Edges
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Punch

# Least error of the added depth, relative: what two finenesses may happen to share.
_LEAST_ERROR = 0.03
# Error of a signal over its difference by two finenesses, found by trial against finer solutions
# (benchmarks/rim_touches.py).
UNCONVERGED = 2.0


@dataclass(frozen=True)
class RimCorrection:
    """What the rim, or a neighbour, changes of an axisymmetric touch."""

    field: RimField
    depth_m: float  # depth added to the axisymmetric one, m
    # ratios of the largest pressure and of the contact areas, face and wall, to the axisymmetric ones
    pressure: float
    area: float
    wall: float
    fraction_non_elliptic: float  # fraction of the quadrature points where strong ellipticity is lost
    residuals: tuple[float, ...]  # relative residual after each iteration
    force: float = 1.0  # ratio of the force to the axisymmetric one: 1 but where the depth is given


@dataclass(frozen=True, eq=False)
class TwoMeshes:
    """A touch near an edge or a neighbour by two meshes, the errors of its signals still those of the axisymmetric one.
    """

    touch: Touch
    alone: Touch  # the axisymmetric one
    body: Body  # disc on which the signals of both meshes are to be compared, and the punch there
    punch: Punch
    rough: RimField  # what changes the axisymmetric touch by the coarser mesh, and by the finer one
    fine: RimField
    edges: Edges | None  # inside which alone the skin is; None: the disc
    left: float  # error of a signal over its difference by both
    part: float = 0.0  # part of what the change makes of the signal that counts as an error, too
    settled: float = 0.0  # relative error of signals that counts in addition
    problem: str = ""  # likely cause, a sentence, where the skin of either is none


def apply_correction(touch: Touch, change: RimCorrection) -> Touch:
    """An axisymmetric touch with a change."""
    area = touch.contact_area_m2 * change.area
    force = touch.force_N * change.force
    return replace(touch, rim=change.field, force_N=force, depth_m=touch.depth_m + change.depth_m,
                   sigma_max_Pa=touch.sigma_max_Pa * change.pressure, contact_area_m2=area, sigma_ave_Pa=force / area,
                   wall_contact_m2=touch.wall_contact_m2 * change.wall, strain_errors=None,
                   fraction_non_elliptic=max(touch.fraction_non_elliptic, change.fraction_non_elliptic))


def with_error(touch: Touch, rough: RimCorrection, change: RimCorrection, body: Body, punch: Punch,
               edges: Edges | None = None, left: float = UNCONVERGED) -> TwoMeshes:
    """An axisymmetric touch with a change, whose difference to a rougher one counts in all errors but those of signals,
    where it counts so many times, on the skin inside edges where they are given."""
    out = apply_correction(touch, change)
    off = max(abs(change.depth_m - rough.depth_m), _LEAST_ERROR * abs(change.depth_m)) / out.depth_m
    off = max(off, abs(change.force - rough.force), _LEAST_ERROR * abs(change.force - 1))
    done = within_face(replace(
        out, depth_error=float(touch.depth_error + off),
        sigma_max_error=_added(touch.sigma_max_error, rough.pressure, change.pressure),
        contact_area_error=_added(touch.contact_area_error, rough.area, change.area),
        contact_end_error=_added(touch.contact_end_error, math.sqrt(rough.area), math.sqrt(change.area)),
        iterations=touch.iterations + len(change.residuals), residuals=touch.residuals + change.residuals), punch)
    return TwoMeshes(done, touch, body, punch, rough.field, change.field, edges, left)


def _added(error: float | None, rough: float, fine: float) -> float | None:
    """An error with the relative difference of two ratios added, at least a part of what the finer one changes."""
    return None if error is None else error + max(abs(rough / fine - 1), _LEAST_ERROR * abs(fine - 1))


def within_face(touch: Touch, punch: Punch) -> Touch:
    """The touch with a contact no larger than the punch's face; ratios of reference areas, which a change gives, may
    exceed it where the foam is drawn under the punch, and the excess counts in the area's error."""
    face = math.pi * punch.diameter_m**2 / 4
    excess = max(touch.contact_area_m2 / face - 1, 0.0)
    error = None if touch.contact_area_error is None else touch.contact_area_error + excess
    area = min(touch.contact_area_m2, face)
    return replace(touch, contact_area_m2=area, sigma_ave_Pa=touch.force_N / area, contact_area_error=error)


def no_correction(field: RimField) -> RimField:
    """A field on the same samples that changes nothing."""
    return replace(field, displacement_m=np.zeros_like(field.displacement_m), normal=np.ones_like(field.normal),
                   metric=np.broadcast_to([1.0, 0.0, 1.0], field.metric.shape))
