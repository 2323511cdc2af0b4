"""A touch near the rim: the axisymmetric one, and what the rim changes of it, solved in three dimensions.

The change is the difference of a clipped disc's solution to the axisymmetric one on the same mesh, so that a mesh much
coarser than the axisymmetric touch's resolves it: the coarse mesh's own errors cancel. A second one, coarser still and
with fewer harmonics, tells the error. The punch keeps its axis upright. Where it sticks, what has stuck in the
axisymmetric touch stays stuck, and the change is that at the end of loading: the way there is not followed.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim import friction, loading
from eitsim.axisymmetric import at_depth, force_unit, pressings, solve_touch, under_force
from eitsim.circles import Circles, Outline, harmonics_at
from eitsim.clipped_disc import ClippedDisc, amplitudes, clipped_disc, unknowns_of
from eitsim.clipped_solution import fraction_non_elliptic, reaction, solve, touching
from eitsim.fourier import Points, gradients
from eitsim.mesh import default_element_m, lagrange, tensor_grid
from eitsim.pressing import Equilibrium, Pressing, interpolation
from eitsim.punch import pressure, top_facets
from eitsim.results import RimField, Touch
from eitsim.scene import Body, Punch
from eitsim.skin import changes, driving_strain, stretches
from eitsim.volume import volume_of
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]

# How far from the punch's edge the change ends, thicknesses.
_BEYOND = 5.0
# Widest element up to there, thicknesses: the rim cuts elements anywhere, and what it changes decays over 0.7.
_WIDEST = 0.5
# Elements are halved along the radius from so far inside the punch's edge to so far beyond it, thicknesses: there the
# strain falls off steeply where the foam leaves the fillet, and the rim moves that place.
_INSIDE, _OUTSIDE = 0.05, 0.2
# Lines closer than this are one, thicknesses.
_NEAR = 1e-9
# Least gap between the punch's edge and the rim, over the disc's radius: with less the rim cuts slivers off elements.
LEAST_GAP = 1e-5
# Points a facet and angles at which the surface is sampled.
_SAMPLES, ANGLES = 3, 25
# Least error of the added depth, relative: what two finenesses may happen to share.
LEAST_ERROR = 0.03
# Part of the local differences of two fields that the signal's error is taken to be at least, by trial against finer
# solutions (benchmarks/rim.py).
_LOCAL = 0.06
# Conductivity of the nominal skin by which two fields are compared is exp(_SENSITIVITY strain).
_SENSITIVITY = -2.0
# Part of what the rim changes that the way to it may alter where the punch sticks: the largest difference of the
# surface's displacement (2-norm) to increments of the three-dimensional problem, 16 for 14 mm, 0.3 N and a gap of 1 mm,
# and 1 N and 5 mm, 8 for 3 N and 5 mm; the added depth differs by 2 % at most.
_WAY = 0.1
# How often the force is halved for a start where the solution is not found from the axisymmetric state.
_HALVINGS = 3
# Where the parts xx, xy, yy of a metric stand.
METRIC = ([0, 0, 1], [0, 1, 1])


@dataclass(frozen=True)
class Fineness:
    """How finely the change is resolved."""

    # element size at the punch's edge over the default one of the axisymmetric touch
    element: float
    # harmonics of the angle, the constant included
    harmonics: int
    # angles on half a circle
    angles: int
    # reference radius, thicknesses beyond the punch's edge, at which the change ends
    beyond: float = _BEYOND
    # widest element up to there, thicknesses
    widest: float = _WIDEST


COARSE, FINE = Fineness(6.0, 5, 12), Fineness(4.0, 7, 14)
WHOLE = Fineness(3.0, 9, 18, np.inf)


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


@dataclass(frozen=True, eq=False)
class Solution:
    """What the rim adds on one mesh."""

    disc: ClippedDisc
    model: Pressing
    state: Equilibrium
    # (unknowns + 1,) what the rim adds
    x: Array
    residuals: tuple[float, ...]


@dataclass(frozen=True)
class Load:
    """What is given: the force over mu_0 H^2, or else the depth over H."""

    force: float | None
    depth: float | None

    def state(self, model: Pressing, sticks: bool) -> tuple[Pressing, Equilibrium]:
        """Axisymmetric equilibrium, and the pressing with what holds the foam there; ValueError where nothing is given.
        """
        if self.force is not None:
            if not sticks:
                return model, under_force([model], self.force)[0]
            _, found = loading.loaded(model, np.inf, loading.at_rest(model), self.force)
        elif self.depth is not None:
            (state,) = at_depth([model], self.depth)
            if not sticks:
                return model, state
            _, found = loading.at_depth_of(model, np.inf, self.depth, state.force)
        else:
            raise ValueError("a punch needs force_N or depth_m, got neither.")
        return replace(model, grip=found.grip), found.state

    def halved(self) -> Load:
        """Half of it."""
        return Load(*(None if part is None else part / 2 for part in (self.force, self.depth)))


def rim_problem(body: Body, punch: Punch) -> str:
    """Why a touch cannot be solved near the rim, without a full stop; empty where it can."""
    gap = body.radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
    least = LEAST_GAP * body.radius_m
    if gap < least:
        where = f"{-gap * 1e3:.1f} mm beyond" if gap <= -5e-5 else "on"
        inwards = (math.floor((least - gap) * 1e5) + 1) / 100
        return (f"the punch's edge lies {where} the rim of the disc; change x_mm and y_mm so that the punch lies "
                f"{inwards:.2f} mm further inwards")
    if punch.conductor:
        return "only an insulated punch is built"
    if 0 < friction.coefficient(punch) < np.inf:
        return "only a punch without friction, or one that sticks, is built (friction = \"none\" or \"stick\")"
    return ""


def solve_near_rim(law: Hyperfoam, body: Body, punch: Punch, *, strain: str = "normal", whole: bool = False) -> Touch:
    """Equilibrium near the rim under the punch's force or at its depth: the axisymmetric touch, and what the rim adds.

    whole: on finer meshes and out to the whole disc. ValueError where `rim_problem` names one, NotConverged where no
    equilibrium is found.
    """
    if problem := rim_problem(body, punch):
        raise ValueError(f"{problem}.")
    if not whole:
        return corrected(solve_touch(law, body, punch, strain=strain), law, body, punch, strain=strain)
    touch = solve_touch(law, body, punch, strain=strain, element_m=default_element_m(body, punch) / 2)
    return corrected(touch, law, body, punch, strain=strain, coarse=FINE, fine=WHOLE)


def corrected(touch: Touch, law: Hyperfoam, body: Body, punch: Punch, *, strain: str = "normal",
              coarse: Fineness = COARSE, fine: Fineness = FINE) -> Touch:
    """An axisymmetric touch with the rim's effect, of finenesses whose difference tells the error; NotConverged where
    no equilibrium is found."""
    started = time.process_time()
    before = _found(law, body, punch, coarse)
    rough = _change_of(before, body)
    after = _found(law, body, punch, fine, before)
    change = _change_of(after, body)
    depth = touch.depth_m + change.depth_m
    apart = max(abs(change.depth_m - rough.depth_m), LEAST_ERROR * abs(change.depth_m)) / depth
    apart = max(apart, abs(change.force - rough.force), LEAST_ERROR * abs(change.force - 1))
    unlike = signal_difference(touch, rough.field, change.field, strain)
    if punch.friction == "stick":
        unlike += _WAY * signal_difference(touch, _unchanged(change.field), change.field, strain)
    touch = replace(changed(touch, change), depth_error=touch.depth_error + apart,
                    signal_error=touch.signal_error + unlike,
                    sigma_max_error=added_error(touch.sigma_max_error, rough.pressure, change.pressure),
                    contact_area_error=added_error(touch.contact_area_error, rough.area, change.area))
    touch = within_face(touch, punch)
    volume = volume_of(after.disc, after.model, after.state, after.x, law, body.thickness_m,
                       math.atan2(punch.y_m, punch.x_m))
    return replace(touch, volume=volume, iterations=touch.iterations + len(rough.residuals) + len(change.residuals),
                   residuals=touch.residuals + rough.residuals + change.residuals,
                   cpu_s=touch.cpu_s + time.process_time() - started)


def added_error(error: float | None, rough: float, fine: float) -> float | None:
    """An error with the relative difference of two ratios added, at least a part of what the finer one changes."""
    return None if error is None else error + max(abs(rough / fine - 1), LEAST_ERROR * abs(fine - 1))


def within_face(touch: Touch, punch: Punch) -> Touch:
    """The touch with a contact no larger than the punch's face; ratios of reference areas, which a change gives, may
    exceed it where the foam is drawn under the punch, and the excess counts in the area's error."""
    face = math.pi * punch.diameter_m**2 / 4
    excess = max(touch.contact_area_m2 / face - 1, 0.0)
    error = None if touch.contact_area_error is None else touch.contact_area_error + excess
    area = min(touch.contact_area_m2, face)
    return replace(touch, contact_area_m2=area, sigma_ave_Pa=touch.force_N / area, contact_area_error=error)


def _unchanged(field: RimField) -> RimField:
    return replace(field, displacement_m=np.zeros_like(field.displacement_m), normal=np.ones_like(field.normal),
                   metric=np.broadcast_to([1.0, 0.0, 1.0], field.metric.shape))


def changed(touch: Touch, change: Change) -> Touch:
    """An axisymmetric touch with a change."""
    area = touch.contact_area_m2 * change.area
    force = touch.force_N * change.force
    return replace(touch, rim=change.field, force_N=force, depth_m=touch.depth_m + change.depth_m,
                   sigma_max_Pa=touch.sigma_max_Pa * change.pressure, contact_area_m2=area,
                   sigma_ave_Pa=force / area, wall_contact_m2=touch.wall_contact_m2 * change.wall,
                   strain_error=None,
                   fraction_non_elliptic=max(touch.fraction_non_elliptic, change.fraction_non_elliptic))


def rim_change(law: Hyperfoam, body: Body, punch: Punch, fineness: Fineness = FINE) -> Change:
    """What the rim changes of the touch under the punch's force or at its depth.

    Radii and angles of the field depend on the body, the punch's size and shape and the fineness alone, so that fields
    of several forces and places on the disc interpolate point by point. NotConverged where no equilibrium is found.
    """
    return _change_of(_found(law, body, punch, fineness), body)


def _change_of(solution: Solution, body: Body) -> Change:
    disc, x, unit = solution.disc, solution.x, body.thickness_m
    pressed, area, wall = contact_ratios(disc, x)
    return Change(_surface_field(disc, solution.model, x, unit), float(x[-1]) * unit, pressed, area, wall,
                  fraction_non_elliptic(disc, x), solution.residuals, force_ratio(solution) if disc.held else 1.0)


def force_ratio(solution: Solution) -> float:
    """Force over the axisymmetric one at the same depth; the contact's penetration, which both are corrected for, goes
    with the force."""
    state, ratio = solution.state, reaction(solution.disc, solution.x) / solution.disc.force
    penetration = float(state.x[-1]) - state.depth
    return ratio - (1 - ratio) * penetration / float(state.by_force[-1] * state.force)


def _found(law: Hyperfoam, body: Body, punch: Punch, fineness: Fineness, before: Solution | None = None) -> Solution:
    """The solution from the axisymmetric state, or from one on another mesh; else by way of half the load."""
    model, load = set_up(law, body, punch, fineness)
    unit = body.thickness_m
    outline = Outline(body.radius_m / unit, float(np.hypot(punch.x_m, punch.y_m)) / unit)
    return _under(model, load, punch.friction == "stick", outline, fineness, before, _HALVINGS)


def set_up(law: Hyperfoam, body: Body, punch: Punch, fineness: Fineness) -> tuple[Pressing, Load]:
    """The discretised foam under a punch, without friction, and what is given."""
    unit, smooth = body.thickness_m, replace(punch, friction="none")
    model = pressings(law, body, smooth, fineness.element * default_element_m(body, punch), None)[-1]
    load = Load(None if punch.force_N is None else punch.force_N / force_unit(law, body),
                None if punch.force_N is not None or punch.depth_m is None else punch.depth_m / unit)
    return _narrowed(model, fineness), load


def _narrowed(model: Pressing, fineness: Fineness) -> Pressing:
    """The pressing with elements halved about the punch's edge, and none wider than the widest as far as the change
    reaches."""
    r, z = (lines[::model.grid.order] for lines in model.grid.lines)
    edge = model.tool.radius
    halved = (r[:-1] > edge - _INSIDE - _NEAR) & (r[1:] < edge + _OUTSIDE)
    parts = [max(math.ceil((b - a) / fineness.widest), 2 if half else 1) if a < edge + fineness.beyond else 1
             for (a, b), half in zip(itertools.pairwise(r), halved, strict=True)]
    r = np.concatenate([[0.0], *(a + (b - a) * np.arange(1, n + 1) / n
                                 for (a, b), n in zip(itertools.pairwise(r), parts, strict=True))])
    grid = tensor_grid(r, z, order=model.grid.order)
    last = model.grid.nodes[model.facets.nodes[-1, -1], 0]
    return replace(model, grid=grid, facets=top_facets(grid, last - _NEAR))


def _under(model: Pressing, load: Load, sticks: bool, outline: Outline, fineness: Fineness,
           before: Solution | None, halvings: int) -> Solution:
    model, state = load.state(model, sticks)
    disc = clipped_disc(model, state, outline, fineness.harmonics, fineness.angles, model.tool.radius + fineness.beyond,
                        held=load.force is None)
    for start in (None if before is None else carried_over(before, disc, model), None):
        try:
            found = solve(disc, start)
            return Solution(disc, model, state, found.x, found.residuals)
        except NotConverged:
            if halvings == 0:
                raise
    half = _under(model, load.halved(), sticks, outline, fineness, None, halvings - 1)
    found = solve(disc, half.x)
    return Solution(disc, model, state, found.x, half.residuals + found.residuals)


def carried_over(before: Solution, disc: ClippedDisc, model: Pressing) -> Array:
    """A solution's unknowns on another disc: what the rim adds at the new nodes, in as many harmonics as both have."""
    old, count = before.disc, min(len(before.disc.fixed), len(disc.fixed))
    along_r = interpolation(old.columns, disc.columns, old.order)
    along_r[disc.columns > old.columns[-1]] = 0.0
    along_z = interpolation(before.model.grid.lines[1], model.grid.lines[1], old.order)
    added = amplitudes(old, before.x[:-1])[..., :count].reshape(len(old.columns), -1, 3 * count)
    out = np.zeros(disc.base.shape)
    out[..., :count] = np.einsum("im,mnk,jn->ijk", along_r, added, along_z, optimize=True).reshape(-1, 3, count)
    return np.append(unknowns_of(disc, out), before.x[-1])


def _surface_field(disc: ClippedDisc, model: Pressing, x: Array, unit: float) -> RimField:
    """Displacement and change of the stretches on the top, on circles as far as they lie inside the disc."""
    points, radius = top_points(disc, model)
    share = np.linspace(0, 1, ANGLES)
    start = disc.outline.start(radius)[:, None]
    angle = start + (np.pi - start) * share
    waves = Circles(np.ones_like(angle), *harmonics_at(angle, len(disc.fixed)))
    points = replace(points, circles=waves)
    added = amplitudes(disc, x[:-1])
    before, after = (deformation(points, a) for a in (disc.base, disc.base + added))
    metric, normal = _change(before, after)
    if not np.all(normal > 0):
        raise NotConverged("the rim's change turns the surface inside out between the points of its mesh. Try a "
                           "smaller force or a larger gap.", estimate=x)
    turn = np.moveaxis(np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), (0, 1), (-2, -1))
    metric = turn @ metric @ np.swapaxes(turn, -1, -2)
    moved = displacement(points, added)
    moved[..., :2] = (turn @ moved[..., :2, None])[..., 0]
    return RimField(radius * unit, share, moved * unit, metric[..., *METRIC], normal, disc.outline.disc * unit,
                    disc.outline.offset * unit)


def top_points(disc: ClippedDisc, model: Pressing) -> tuple[Points, Array]:
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


def deformation(points: Points, amplitude: Array) -> Array:
    """Deformation gradients (circles, angles, 3, 3)."""
    strain = np.moveaxis(gradients(points, amplitude), 1, 2)
    return np.eye(3) + strain.reshape(*strain.shape[:2], 3, 3)


def displacement(points: Points, amplitude: Array) -> Array:
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


def contact_ratios(disc: ClippedDisc, x: Array) -> tuple[float, float, float]:
    """Ratios of the largest pressure, a facet's average, and of the areas of face and wall to the axisymmetric ones."""
    at, before = touching(disc, x), touching(replace(disc, outside=None), np.zeros_like(x))
    facets, weight = len(disc.facing.nodes), disc.facing.weight
    share = disc.facing.radius.reshape(facets, -1, 1)

    def largest(gap: Array) -> float:
        held = pressure(disc.tool, gap).reshape(facets, -1, gap.shape[1])
        return float(((share * held).sum(axis=1) / share.sum(axis=1)).max())

    def areas(gap: Array, wall: NDArray[np.bool_]) -> tuple[float, float]:
        return float(weight[(gap > 0) & ~wall].sum()), float(weight[(gap > 0) & wall].sum())

    (face, wall), (old_face, old_wall) = areas(at.gap, at.wall), areas(before.gap, before.wall)
    return largest(at.gap) / largest(before.gap), face / old_face, wall / old_wall if old_wall > 0 else 1.0


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
