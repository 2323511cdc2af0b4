"""A touch near the rim: the axisymmetric one, and what the rim changes of it, solved in three dimensions.

The change is the difference of a clipped disc's solution to the axisymmetric one on the same mesh, so that a mesh much
coarser than the axisymmetric touch's resolves it: the coarse mesh's own errors cancel. A second one, coarser still and
with fewer harmonics, tells the error. The punch keeps its axis upright.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.axisymmetric import force_unit, pressings, solve_touch, under_force
from eitsim.circles import Circles, Outline, harmonics_at
from eitsim.clipped_disc import ClippedDisc, amplitudes, clipped_disc
from eitsim.clipped_solution import fraction_non_elliptic, solve, touching
from eitsim.fourier import Points, gradients
from eitsim.mesh import default_element_m, lagrange
from eitsim.newton import Minimum
from eitsim.pressing import Pressing
from eitsim.punch import pressure
from eitsim.results import RimField, Touch
from eitsim.scene import Body, Punch
from eitsim.skin import changes
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]

# Reference radius, thicknesses beyond the punch's edge, at which the change ends.
_BEYOND = 5.0
# Points a facet and angles at which the surface is sampled.
_SAMPLES, _ANGLES = 3, 25
# How often the force is halved for a start where the solution is not found from the axisymmetric state.
_HALVINGS = 3
# Where the parts xx, xy, yy of a metric stand.
_METRIC = ([0, 0, 1], [0, 1, 1])


@dataclass(frozen=True)
class Fineness:
    """How finely the change is resolved."""

    # element size at the punch's edge over the default one of the axisymmetric touch
    element: float
    # harmonics of the angle, the constant included
    harmonics: int
    # angles on half a circle
    angles: int


COARSE, FINE = Fineness(6.0, 5, 12), Fineness(4.0, 7, 14)


@dataclass(frozen=True)
class Change:
    """What the rim changes of an axisymmetric touch."""

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


def rim_problem(body: Body, punch: Punch) -> str:
    """Why a touch cannot be solved near the rim, without a full stop; empty where it can."""
    gap = body.radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
    if gap <= 0:
        return (f"the punch's edge lies {-gap * 1e3:.1f} mm beyond the rim of the disc; move it inwards by more than "
                "that")
    if punch.friction != "none" or punch.force_N is None or punch.conductor:
        return "only a frictionless, insulated punch under a given force (force_N) is built"
    return ""


def solve_near_rim(law: Hyperfoam, body: Body, punch: Punch, *, strain: str = "normal") -> Touch:
    """Equilibrium near the rim under the punch's force: the axisymmetric touch, and what the rim adds to it.

    ValueError where `rim_problem` names one, NotConverged where no equilibrium is found.
    """
    if problem := rim_problem(body, punch):
        raise ValueError(f"{problem}.")
    return corrected(solve_touch(law, body, punch, strain=strain), law, body, punch)


def corrected(touch: Touch, law: Hyperfoam, body: Body, punch: Punch, *, coarse: Fineness = COARSE,
              fine: Fineness = FINE) -> Touch:
    """An axisymmetric touch with the rim's effect, of finenesses whose difference tells the error; NotConverged where
    no equilibrium is found."""
    started = time.process_time()
    rough, change = (rim_change(law, body, punch, fineness) for fineness in (coarse, fine))
    depth_error = abs(change.depth_m - rough.depth_m) / (touch.depth_m + change.depth_m)
    touch = replace(changed(touch, change), depth_error=touch.depth_error + depth_error,
                    signal_error=touch.signal_error + field_difference(touch, rough.field, change.field))
    return replace(touch, iterations=touch.iterations + len(rough.residuals) + len(change.residuals),
                   residuals=touch.residuals + rough.residuals + change.residuals,
                   cpu_s=touch.cpu_s + time.process_time() - started)


def changed(touch: Touch, change: Change) -> Touch:
    """An axisymmetric touch with a change."""
    area = touch.contact_area_m2 * change.area
    return replace(touch, rim=change.field, depth_m=touch.depth_m + change.depth_m,
                   sigma_max_Pa=touch.sigma_max_Pa * change.pressure, contact_area_m2=area,
                   sigma_ave_Pa=touch.force_N / area, wall_contact_m2=touch.wall_contact_m2 * change.wall,
                   fraction_non_elliptic=max(touch.fraction_non_elliptic, change.fraction_non_elliptic))


def rim_change(law: Hyperfoam, body: Body, punch: Punch, fineness: Fineness = FINE) -> Change:
    """What the rim changes of the touch under the punch's force.

    Radii and angles of the field depend on the body, the punch's size and shape and the fineness alone, so that fields
    of several forces and places on the disc interpolate point by point. NotConverged where no equilibrium is found.
    """
    if punch.force_N is None:
        raise ValueError(f"force_N must be given, got depth_m = {punch.depth_m}.")
    unit = body.thickness_m
    model = pressings(law, body, punch, fineness.element * default_element_m(body, punch), None)[-1]
    outline = Outline(body.radius_m / unit, float(np.hypot(punch.x_m, punch.y_m)) / unit)
    disc, found = _found(model, punch.force_N / force_unit(law, body), outline, fineness, _HALVINGS)
    pressed, area, wall = _contact_ratios(disc, found.x)
    return Change(_surface_field(disc, model, found.x, unit), float(found.x[-1]) * unit, pressed, area, wall,
                  fraction_non_elliptic(disc, found.x), found.residuals)


def _found(model: Pressing, force: float, outline: Outline, fineness: Fineness,
           halvings: int) -> tuple[ClippedDisc, Minimum]:
    """The solution from the axisymmetric state, or by way of what the rim adds under half the force."""
    (state,) = under_force([model], force)
    disc = clipped_disc(model, state, outline, fineness.harmonics, fineness.angles, model.tool.radius + _BEYOND)
    try:
        return disc, solve(disc)
    except NotConverged:
        if halvings == 0:
            raise
    return disc, solve(disc, _found(model, force / 2, outline, fineness, halvings - 1)[1].x)


def _surface_field(disc: ClippedDisc, model: Pressing, x: Array, unit: float) -> RimField:
    """Displacement and change of the stretches on the top, on circles as far as they lie inside the disc."""
    points, radius = _top(disc, model)
    share = np.linspace(0, 1, _ANGLES)
    start = disc.outline.start(radius)[:, None]
    angle = start + (np.pi - start) * share
    waves = Circles(np.ones_like(angle), *harmonics_at(angle, len(disc.fixed)))
    points = replace(points, circles=waves)
    added = amplitudes(disc, x[:-1])
    before, after = (_gradient(points, a) for a in (disc.base, disc.base + added))
    metric, normal = _change(before, after)
    if not np.all(normal > 0):
        raise NotConverged("the rim's change turns the surface inside out between the points of its mesh. Try a "
                           "smaller force or a larger gap.", estimate=x)
    turn = np.moveaxis(np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), (0, 1), (-2, -1))
    metric = turn @ metric @ np.swapaxes(turn, -1, -2)
    moved = _displacement(points, added)
    moved[..., :2] = (turn @ moved[..., :2, None])[..., 0]
    return RimField(radius * unit, share, moved * unit, metric[..., *_METRIC], normal, disc.outline.disc * unit,
                    disc.outline.offset * unit)


def _top(disc: ClippedDisc, model: Pressing) -> tuple[Points, Array]:
    """Points of the surface, Gauss points of the top facets, each with a circle of its own (yet to be sampled)."""
    grid, p = model.grid, disc.order
    top = grid.top[grid.top.max(axis=1) < len(disc.base)]
    t = np.polynomial.legendre.leggauss(_SAMPLES)[0]
    shape, slope = lagrange(p, t)
    rows, ends = grid.lines[1], grid.nodes[top][:, [0, -1], 0]
    up = lagrange(p, np.ones(1))[1][0] * 2 / (rows[-1] - rows[-1 - p])
    radius = ends.mean(axis=1)[:, None] + np.diff(ends) / 2 * t
    nodes = (top[:, :, None] + np.arange(-p, 1)).reshape(len(top), 1, -1)
    out = np.zeros((*radius.shape, p + 1, p + 1, 3))
    out[..., -1, 0] = slope * 2 / np.diff(ends)[:, :, None]
    out[..., 1] = shape[:, :, None] * up
    out[..., -1, 2] = shape / radius[..., None]
    count = radius.size
    nodes = np.ascontiguousarray(np.broadcast_to(nodes, (*radius.shape, nodes.shape[-1])).reshape(count, -1))
    return Points(out.reshape(count, -1, 3), nodes, np.arange(count), disc.foam.circles), radius.ravel()


def _gradient(points: Points, amplitude: Array) -> Array:
    """Deformation gradients (circles, angles, 3, 3)."""
    strain = np.moveaxis(gradients(points, amplitude), 1, 2)
    return np.eye(3) + strain.reshape(*strain.shape[:2], 3, 3)


def _displacement(points: Points, amplitude: Array) -> Array:
    """Displacements (circles, angles, 3) in the local frame."""
    radius = 1 / points.shape[..., 2].sum(axis=1)
    at = np.einsum("ra,racm->rcm", points.shape[..., 2] * radius[:, None], amplitude[points.nodes])
    even, odd = np.einsum("rcm,rmj->rjc", at, points.circles.cosine), at[:, 1, None] @ points.circles.sine
    even[..., 1] = odd[:, 0]
    return even


def _change(before: Array, after: Array) -> tuple[Array, Array]:
    """In-plane metric (..., 2, 2) of `after` seen from the stretches `before`, and the ratio of the stretches normal to
    the surface."""
    old, new = (np.swapaxes(f[..., :2], -1, -2) @ f[..., :2] for f in (before, after))
    value, vector = np.linalg.eigh(old)
    inverse = (vector / np.sqrt(value)[..., None, :]) @ np.swapaxes(vector, -1, -2)
    areal = np.sqrt(np.linalg.det(new) / np.linalg.det(old))
    return inverse @ new @ inverse, np.linalg.det(after) / np.linalg.det(before) / areal


def _contact_ratios(disc: ClippedDisc, x: Array) -> tuple[float, float, float]:
    """Ratios of the largest pressure, a facet's average, and of the areas of face and wall to the axisymmetric ones."""
    at, before = touching(disc, x), touching(disc, np.zeros_like(x))
    facets, weight = len(disc.facing.nodes), disc.facing.weight
    share = disc.facing.radius.reshape(facets, -1, 1)

    def largest(gap: Array) -> float:
        held = pressure(disc.tool, gap).reshape(facets, -1, gap.shape[1])
        return float(((share * held).sum(axis=1) / share.sum(axis=1)).max())

    def areas(gap: Array, wall: NDArray[np.bool_]) -> tuple[float, float]:
        return float(weight[(gap > 0) & ~wall].sum()), float(weight[(gap > 0) & wall].sum())

    (face, wall), (old_face, old_wall) = areas(at.gap, at.wall), areas(before.gap, before.wall)
    return largest(at.gap) / largest(before.gap), face / old_face, wall / old_wall if old_wall > 0 else 1.0


def field_difference(touch: Touch, rough: RimField, field: RimField) -> float:
    """Difference of the stretches of two fields, integral of its magnitude over the disc, over that of the axisymmetric
    strains."""
    disc = Outline(field.disc_m, field.offset_m)
    start = disc.start(field.radius_m)[:, None]
    angle = start + (np.pi - start) * field.share
    points = field.radius_m[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    metric, normal = changes(rough, points)
    finer = field.metric[..., [0, 1, 1, 2]].reshape(metric.shape)
    apart = np.abs(finer - metric).sum(axis=(-2, -1)) / 2 + np.abs(field.normal - normal)
    part = 1 - start[:, 0] / np.pi
    stretch = np.stack([np.interp(field.radius_m, touch.radius_m, s) for s in (
        touch.stretch_meridian, touch.stretch_hoop, touch.stretch_normal)])
    ring = np.gradient(field.radius_m) * field.radius_m
    return float((apart.mean(axis=1) * part * ring).sum() / (np.abs(stretch - 1).sum(axis=0) * ring).sum())
