"""A touch near the rim: the axisymmetric one, corrected on two meshes of a patch, and the surface as the skin needs it.

The two meshes tell the error. Contact stresses and areas are the axisymmetric ones times what the correction makes of
them at the patch's own points of contact, which alone are too coarse to resolve the edge's pressure.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import ElementHex2, FacetBasis

from eitsim import patch_base
from eitsim.axisymmetric import solve_state
from eitsim.newton import Minimum
from eitsim.patch3d import Patch, correction, make_patch, nodal, nodes_of, points_of, pressed, values_of
from eitsim.patch_base import Base, base_of
from eitsim.patch_mesh import Fineness, Outline
from eitsim.results import RimField, Touch
from eitsim.scene import Body, Punch
from eitsim.skin import changes
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]

# Radius of the patch in thicknesses: at least this, and this much beyond the nearest point of the rim.
_REACH, _BEYOND = 3.5, 1.5
# Largest fillet over the punch's radius.
_WIDEST_FILLET = 0.8
COARSE = Fineness()
FINE = Fineness(core=2, inner=3, edge=3, outer=5, layers=(-1.0, -0.6, -0.2, 0.0))
# Points a facet and direction at which the surface is sampled, its sides included.
_SAMPLES = 4
# Largest part of the samples that may be left out since the foam is turned inside out there.
_MOST_LEFT_OUT = 0.03
# Radii and angles at which the fields of the two meshes are compared.
_RADII, _ANGLES = 200, 60


@dataclass(frozen=True)
class _Solved:
    patch: Patch
    x: Array
    field: RimField
    residuals: tuple[float, ...]


def outline_of(body: Body, punch: Punch) -> Outline:
    """The patch of a punch, lengths in thicknesses; ValueError where it does not fit."""
    if problem := patch_problem(body, punch):
        raise ValueError(f"{problem}.")
    unit = body.thickness_m
    offset, disc = float(np.hypot(punch.x_m, punch.y_m)) / unit, body.radius_m / unit
    return Outline(disc, offset, punch.diameter_m / 2 / unit, punch.fillet_m / unit,
                   max(_REACH, disc - offset + _BEYOND))


def patch_problem(body: Body, punch: Punch) -> str:
    """Why no patch fits the punch, without a full stop; empty where one does."""
    gap = body.radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
    if gap <= 0:
        return (f"the punch's edge lies {-gap * 1e3:.1f} mm beyond the rim of the disc; move it inwards by more than "
                "that")
    if punch.profile != "flat" or punch.friction != "none" or punch.force_N is None or punch.conductor:
        return "only a flat, frictionless, insulated punch under a given force (force_N) is built"
    if punch.fillet_m > _WIDEST_FILLET * punch.diameter_m / 2:
        return (f"fillet_mm may be at most {_WIDEST_FILLET * punch.diameter_m * 500:g} ({_WIDEST_FILLET:g} of the "
                f"punch's radius), got {punch.fillet_m * 1e3:g}")
    patch = max(_REACH * body.thickness_m, punch.diameter_m / 2 + gap + _BEYOND * body.thickness_m)
    if patch >= body.radius_m:
        return (f"the disc (radius {body.radius_m * 1e3:g} mm) must be larger than the patch about the punch "
                f"({patch * 1e3:.0f} mm)")
    return ""


def solve_near_rim(law: Hyperfoam, body: Body, punch: Punch, *, strain: str = "normal") -> Touch:
    """Equilibrium near the rim under the punch's force: the axisymmetric touch, and what the rim adds to it.

    ValueError where no patch fits the punch, NotConverged where no equilibrium or no correction is found.
    """
    outline = outline_of(body, punch)
    if punch.force_N is None:
        raise ValueError(patch_problem(body, punch))
    touch, model, state = solve_state(law, body, punch, punch.force_N, strain=strain)
    return corrected(touch, base_of(model, state), outline, body)


def corrected(touch: Touch, base: Base, outline: Outline, body: Body) -> Touch:
    """An axisymmetric touch with the rim's effect; NotConverged where no correction is found."""
    started = time.process_time()
    coarse, fine = (_solved(base, outline, fineness, body.thickness_m) for fineness in (COARSE, FINE))
    force, area = _contact_ratios(fine)
    added = float(fine.x[-1]) * body.thickness_m
    depth = float(touch.depth_m + added)
    depth_error = abs(float(fine.x[-1] - coarse.x[-1])) * body.thickness_m / depth
    residuals = coarse.residuals + fine.residuals
    return replace(
        touch, rim=fine.field, depth_m=depth, sigma_max_Pa=touch.sigma_max_Pa * force,
        contact_area_m2=touch.contact_area_m2 * area, sigma_ave_Pa=touch.sigma_ave_Pa / area,
        depth_error=touch.depth_error + depth_error,
        signal_error=touch.signal_error + _field_error(touch, outline, body.thickness_m, coarse.field, fine.field),
        iterations=touch.iterations + len(residuals), residuals=touch.residuals + residuals,
        cpu_s=touch.cpu_s + time.process_time() - started)


def _solved(base: Base, outline: Outline, fineness: Fineness, unit: float) -> _Solved:
    patch = make_patch(base, outline, fineness)
    found: Minimum = correction(patch)
    return _Solved(patch, found.x, _surface_field(base, patch, found.x, outline, unit), found.residuals)


def _surface_field(base: Base, patch: Patch, x: Array, outline: Outline, unit: float) -> RimField:
    """Displacement and change of the stretches on the whole top of the patch."""
    mesh = patch.mesh
    boundary = mesh.boundary_facets()
    top = boundary[np.abs(mesh.doflocs[2][np.asarray(mesh.facets)[:, boundary]]).max(axis=0) < 1e-6]
    line = np.linspace(0, 1, _SAMPLES)
    places = np.stack([a.ravel() for a in np.meshgrid(line, line)])
    basis = FacetBasis(mesh, ElementHex2(), facets=top, quadrature=(places, np.ones(places.shape[1])))
    points, u = points_of(basis), nodal(patch, x[:-1])[nodes_of(basis)]
    slope = np.stack([np.moveaxis(np.asarray(f.grad), 0, -1) for (f,) in basis.basis], axis=-2)
    before = patch_base.gradient(base, points)
    after = before + np.einsum("fai,fqaj->fqij", u, slope)
    upright = np.linalg.det(after) > 0
    left_out = float(1 - upright.mean())
    if left_out > _MOST_LEFT_OUT:
        raise NotConverged(f"the rim's correction turns {left_out:.1%} of the surface's samples inside out, which lie "
                           "between the points of its mesh. Try a smaller force or a larger gap.", estimate=x)
    metric, normal = _change(before[upright], after[upright])
    where, shift = points[upright][:, :2], (values_of(basis) @ u)[upright]
    values = np.column_stack([shift * unit, metric, normal])
    key, inverse = np.unique(np.round(where, 9), axis=0, return_inverse=True)
    mean = np.zeros((len(key), values.shape[1]))
    np.add.at(mean, inverse.ravel(), values)
    mean /= np.bincount(inverse.ravel())[:, None]
    return RimField(key * unit, mean[:, :3], mean[:, 3:6], mean[:, 6], outline.reach * unit,
                    _jump(key, mean, outline.reach), left_out)


def _change(before: Array, after: Array) -> tuple[Array, Array]:
    """In-plane metric of `after` seen from the stretched state `before`, parts xx, xy, yy, and the ratio of the
    stretches normal to the surface."""
    old, new = (np.swapaxes(f[..., :2], -1, -2) @ f[..., :2] for f in (before, after))
    value, vector = np.linalg.eigh(old)
    inverse = (vector / np.sqrt(value)[..., None, :]) @ np.swapaxes(vector, -1, -2)
    metric = inverse @ new @ inverse
    areal = np.sqrt(np.linalg.det(new) / np.linalg.det(old))
    return metric[..., [0, 0, 1], [0, 1, 1]], np.linalg.det(after) / np.linalg.det(before) / areal


def _jump(points: Array, values: Array, reach: float) -> float:
    """Largest change of a stretch, relative, on the circle where the field ends."""
    outer = np.hypot(points[:, 0], points[:, 1]) > reach * (1 - 1e-6)
    metric = np.abs(values[outer, 3:6] - [1, 0, 1]).max() / 2
    return float(max(metric, np.abs(values[outer, 6] - 1).max()))


def _contact_ratios(solved: _Solved) -> tuple[float, float]:
    """Ratios of the largest pressure, a facet's average, and of the contact area to the axisymmetric ones."""
    facing = solved.patch.facing
    pressure = pressed(solved.patch, solved.x)[0]
    share = facing.weight / facing.weight.sum(axis=1, keepdims=True)
    largest = [float((share * p).sum(axis=1).max()) for p in (pressure, facing.pressure)]
    area = [float(facing.weight[p > 0].sum()) for p in (pressure, facing.pressure)]
    return largest[0] / largest[1], area[0] / area[1]


def _field_error(touch: Touch, outline: Outline, unit: float, coarse: RimField, fine: RimField) -> float:
    """Change of the stretches by the mesh, integral of its magnitude, over that of the axisymmetric strains."""
    radius, angle = np.meshgrid((np.arange(_RADII) + 0.5) / _RADII * outline.reach,
                                (np.arange(_ANGLES) + 0.5) / _ANGLES * np.pi)
    inside = radius < outline.rim(angle)
    radius, angle = radius[inside] * unit, angle[inside]
    points = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    (metric, normal), (finer, finer_normal) = changes(coarse, points), changes(fine, points)
    stretch = np.stack([np.interp(radius, touch.radius_m, s) for s in (touch.stretch_meridian, touch.stretch_hoop,
                                                                      touch.stretch_normal)])
    apart = np.abs(finer - metric).sum(axis=(1, 2)) / 2 + np.abs(finer_normal - normal)
    return float((apart * radius).sum() / (np.abs(stretch - 1).sum(axis=0) * radius).sum())
