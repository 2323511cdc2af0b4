"""One punch's touch out of a layer solved with others: its contact, and the surface's means over the angle about it."""

from typing import NamedTuple

import numpy as np

from eitsim.mechanics.general.layer import solid_assembly
from eitsim.mechanics.general.mesh_errors import Corrected
from eitsim.mechanics.general.solved_layer import Solved
from eitsim.mechanics.solid import spatial_response
from eitsim.scene.results import SurfaceField, Touch
from eitsim.scene.scene import STRAINS, Body
from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.law import Law
from touchcal.arrays import Array

# Directions and radii of the means, and how far they go, thicknesses from the punch's edge.
_DIRECTIONS, _RADII, _REACH = 32, 240, 2.0
# Floors of the relative errors of the largest pressure and of the contact area.
_PEAK_FLOOR, _AREA_FLOOR = 0.02, 2e-3


def touch_about(k: int, fine: Corrected, rough: Corrected, law: Law, body: Body) -> Touch:
    """The touch of punch k, its pressure the mean one; errors that need all punches are those of `solve_general`."""
    press, unit = fine.solved.model.presses[k], body.thickness_m
    contact, coarse = fine.contacts[k], rough.contacts[k]
    force_N = float(fine.forces[k]) * law.mu_0_Pa * unit**2
    area = min(contact.area, np.pi * press.rigid.profile.radius**2)
    means = _means(fine.field, press.axis * unit, body, (press.rigid.profile.radius + _REACH) * unit)
    ends = np.linalg.norm(fine.field.contact_curves_m[k] - press.axis * unit, axis=1)
    reach = float(ends.max(initial=0.0))
    average = force_N / (area * unit**2)
    residuals = rough.solved.residuals + fine.solved.residuals
    changed = abs(coarse.area / contact.area - 1)
    return Touch(
        radius_m=means.radius_m, u_r_m=means.u_r_m, u_z_m=means.u_z_m, stretch_meridian=means.meridian,
        stretch_hoop=means.hoop, stretch_normal=means.normal,
        pressure_Pa=np.where(means.radius_m <= reach, average, 0.0), contact_radius_m=reach, surface=fine.field,
        contact_ends_m=ends if len(ends) else None,
        force_N=force_N, depth_m=float(fine.depths[k]) * unit, sigma_max_Pa=contact.largest * law.mu_0_Pa,
        sigma_ave_Pa=average, contact_area_m2=area * unit**2, wall_contact_m2=contact.wall * unit**2, depth_error=0.0,
        signal_errors=np.zeros(len(STRAINS)), fraction_non_elliptic=_non_elliptic(fine.solved),
        iterations=len(residuals), residuals=residuals, cpu_s=0.0,
        sigma_max_error=max(abs(coarse.largest / contact.largest - 1), _PEAK_FLOOR),
        contact_area_error=max(changed, contact.area / area - 1, _AREA_FLOOR),
        contact_end_error=contact.end_error + changed / 2)


class Means(NamedTuple):
    """Means over the directions in which the skin goes on, at radii (n,) about an axis."""

    radius_m: Array
    u_r_m: Array
    u_z_m: Array
    meridian: Array
    hoop: Array
    normal: Array


def _means(field: SurfaceField, axis_m: Array, body: Body, reach_m: float) -> Means:
    """Displacements and stretches about an axis, m."""
    angle = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    radius = reach_m * (np.arange(_RADII) / (_RADII - 1)) ** 1.2
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    points = axis_m + radius[:, None, None] * way
    skin = body.edge.contains(points)
    there = skin.any(axis=1)
    radius, points, skin = radius[there], points[there], skin[there]
    metric, normal = field.metric(points)
    moved, across = field.displacement(points), np.column_stack([-way[:, 1], way[:, 0]])

    def mean(values: Array) -> Array:
        return np.sum(values * skin, axis=1) / skin.sum(axis=1)

    along, around = (np.sqrt(np.einsum("ki,nkij,kj->nk", d, metric, d)) for d in (way, across))
    return Means(radius, mean(np.einsum("nkj,kj->nk", moved[..., :2], way)), mean(moved[..., 2]), mean(along),
                 mean(around), mean(normal))


def _non_elliptic(solved: Solved) -> float:
    """Fraction of the quadrature points at which the law is not strongly elliptic."""
    grad_u = solid_assembly.displacement_gradient(solved.model.mesh, solved.field.moved)
    return float(1 - np.mean(strongly_elliptic(solved.model.law, spatial_response.principal(grad_u).log)))
