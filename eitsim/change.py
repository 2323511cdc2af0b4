"""What the rim, or a neighbour, changes of an axisymmetric touch, and how well that is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.circles import Outline
from eitsim.results import RimField, Touch
from eitsim.scene import Punch
from eitsim.skin import changes, driving_strain, stretches

Array = NDArray[np.float64]

# Least error of the added depth, relative: what two finenesses may happen to share.
_LEAST_ERROR = 0.03
# Part of the local differences of two fields that the signal's error is taken to be at least, by trial against finer
# solutions (benchmarks/rim.py).
_LOCAL = 0.06
# Conductivity of the nominal skin by which two fields are compared is exp(_SENSITIVITY strain).
_SENSITIVITY = -2.0


@dataclass(frozen=True)
class Change:
    """What the rim, or a neighbour, changes of an axisymmetric touch."""

    field: RimField
    # depth added to the axisymmetric one, m
    depth_m: float
    # ratios of the largest pressure and of the contact areas, face and wall, to the axisymmetric ones
    pressure: float
    area: float
    wall: float
    # fraction of the quadrature points where strong ellipticity is lost
    fraction_non_elliptic: float
    # relative residual after each iteration
    residuals: tuple[float, ...]
    # ratio of the force to the axisymmetric one: 1 but where the depth is given
    force: float = 1.0


def changed(touch: Touch, change: Change) -> Touch:
    """An axisymmetric touch with a change."""
    area = touch.contact_area_m2 * change.area
    force = touch.force_N * change.force
    return replace(touch, rim=change.field, force_N=force, depth_m=touch.depth_m + change.depth_m,
                   sigma_max_Pa=touch.sigma_max_Pa * change.pressure, contact_area_m2=area,
                   sigma_ave_Pa=force / area, wall_contact_m2=touch.wall_contact_m2 * change.wall,
                   strain_error=None,
                   fraction_non_elliptic=max(touch.fraction_non_elliptic, change.fraction_non_elliptic))


def told(touch: Touch, rough: Change, change: Change, punch: Punch, strain: str) -> Touch:
    """An axisymmetric touch with a change, whose difference to a rougher one counts in the errors."""
    out = changed(touch, change)
    apart = max(abs(change.depth_m - rough.depth_m), _LEAST_ERROR * abs(change.depth_m)) / out.depth_m
    apart = max(apart, abs(change.force - rough.force), _LEAST_ERROR * abs(change.force - 1))
    return within_face(replace(
        out, depth_error=float(touch.depth_error + apart),
        signal_error=touch.signal_error + signal_difference(touch, rough.field, change.field, strain),
        sigma_max_error=_added(touch.sigma_max_error, rough.pressure, change.pressure),
        contact_area_error=_added(touch.contact_area_error, rough.area, change.area),
        iterations=touch.iterations + len(change.residuals), residuals=touch.residuals + change.residuals), punch)


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


def unchanged(field: RimField) -> RimField:
    """A field on the same samples that changes nothing."""
    return replace(field, displacement_m=np.zeros_like(field.displacement_m), normal=np.ones_like(field.normal),
                   metric=np.broadcast_to([1.0, 0.0, 1.0], field.metric.shape))


def signal_difference(touch: Touch, rough: RimField, field: RimField, strain: str) -> float:
    """Relative difference of what two fields change of the conductance of a nominal skin.

    A voltage changes, to first order, by integrals of that tensor with weights that vary slowly over a touch: the
    difference of the integrals over the disc, but at least a part of the integral of the difference's magnitude.
    """
    disc = Outline(field.disc_m, field.offset_m)
    start = disc.start(field.radius_m)[:, None]
    angle = start + (np.pi - start) * field.share
    outwards = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    radius = np.broadcast_to(field.radius_m[:, None], angle.shape)
    meridian, hoop, normal = stretches(touch, radius)
    old = hoop[..., None, None] * np.eye(2)
    old = old + (meridian - hoop)[..., None, None] * outwards[..., :, None] * outwards[..., None, :]
    weight = (np.gradient(field.radius_m) * field.radius_m)[:, None] * (1 - start / np.pi)
    found = []
    for one in (rough, field):
        metric, factor = changes(one, radius[..., None] * outwards)
        metric = old @ metric @ old
        stretch = np.sqrt(np.moveaxis(np.linalg.eigvalsh(metric), -1, 0))
        driving = driving_strain(strain, stretch[0], stretch[1], normal * factor)
        sheet = np.exp(_SENSITIVITY * driving) * stretch[0] * stretch[1]
        found.append(weight[..., None, None] * (sheet[..., None, None] * np.linalg.inv(metric) - np.eye(2)))
    whole, apart = found[1], found[1] - found[0]
    inside = float(np.linalg.norm(np.diagonal(apart.sum(axis=(0, 1)))) / np.linalg.norm(np.diagonal(whole.sum((0, 1)))))
    return max(inside, _LOCAL * float(np.abs(apart).sum() / np.abs(whole).sum()))
