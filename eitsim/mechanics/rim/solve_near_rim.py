"""A touch near the rim: the axisymmetric one, and what the rim changes of it, solved in three dimensions.

The change is the difference of a clipped disc's solution to the axisymmetric one on the same mesh, so that a mesh much
coarser than the axisymmetric touch's resolves it: the coarse mesh's own errors cancel. A second one, coarser still and
with fewer harmonics, gives the error. Deep touches at the rim itself, which the finer mesh takes a minute for or does
not find, take that coarser one, and the error from a rougher one. The punch keeps its axis upright. Where it sticks,
what has stuck in the axisymmetric touch stays stuck, and the change is that at the end of loading: the way there is not
followed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric import friction_increments, solve_axisymmetric
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem, interpolation
from eitsim.mechanics.axisymmetric.solve_axisymmetric import mesh_hierarchy, solve_touch
from eitsim.mechanics.contact import friction
from eitsim.mechanics.contact.punch_contact import top_facets
from eitsim.mechanics.harmonics.arcs import OffsetDisc, OffsetOutline
from eitsim.mechanics.harmonics.clipped_disc import ClippedDisc, amplitudes, clipped_disc, unknowns_of
from eitsim.mechanics.harmonics.equilibrium import fraction_non_elliptic, reaction, solve
from eitsim.mechanics.rim.clipped_surface import contact_ratios, deformation, displacement, field, samples
from eitsim.mechanics.rim.correction import UNCONVERGED, RimCorrection, TwoMeshes, with_error
from eitsim.mechanics.rim.displacement_field import volume_of
from eitsim.mechanics.solid.grid import default_element_m, tensor_grid
from eitsim.numerics.work_budget import bounded
from eitsim.scene.edges.disc import Disc
from eitsim.scene.polygons import corners_and_edges
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Punch, rim_gap_m
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

# Elements are split along the radius from inside the punch's edge to so far outside it, thicknesses: there the strain
# falls off steeply where the foam leaves the fillet, and the rim moves that place.
_OUTSIDE = 0.2
# Lines closer than this are one, thicknesses.
_NEAR = 1e-9
# Least gap between the punch's edge and the rim, over the disc's radius: with less the rim cuts slivers off elements.
LEAST_GAP = 1e-5
# Part of what the rim changes that the way to it may alter where the punch sticks: the largest difference of the
# surface's displacement (2-norm) to increments of the three-dimensional problem, 16 for 14 mm, 0.3 N and a gap of 1 mm,
# and 1 N and 5 mm, 8 for 3 N and 5 mm; the added depth differs by 2 % at most.
_WAY = 0.1
# Chords of a polygon that stands for a disc where a neighbour is near, too.
# How often the force is halved for a start where the solution is not found from the axisymmetric state.
_HALVINGS = 3
# Iterations on the coarse mesh above which the finer one is not tried: ten times the work of the coarse one, mostly in
# vain. Touches shallower than half the thickness take fewer.
_HARD = 30
# Error of a signal on the coarse mesh over its difference to the rough one: errors fall with the element size, whose
# ratio is 4/3, as UNCONVERGED is of the ratio 3/2 of the finer pair.
_ROUGHLY = 3.0
# Factorisations on the mesh in three dimensions whose work the change may take: the dearest random scene takes 1050.
FACTORISATIONS = 2000


@dataclass(frozen=True)
class Resolution:
    """How finely the change is resolved."""

    element: float  # element size at the punch's edge over the default one of the axisymmetric touch
    harmonics: int  # harmonics of the angle, the constant included
    angles: int  # angles on half a circle
    out_to: float = 5.0  # reference radius, thicknesses outside the punch's edge, at which the change ends
    # widest element up to there, thicknesses: the rim cuts elements anywhere, and what it changes decays over 0.7
    widest: float = 0.5
    parts: int = 2  # into which elements about the punch's edge are split
    inside: float = 0.05  # how far inside it, thicknesses
    # widest parts of an element on either side of the punch's fillet, over the distance of its farther end from there
    grading: float = np.inf


ROUGH, COARSE, FINE = Resolution(8.0, 4, 10), Resolution(6.0, 5, 12), Resolution(4.0, 7, 14)
# Of a touch near one edge of an outline: strains in plane, which the surface shows steepest just outside the fillet and
# at the edge, are half to four fifths as far off as by FINE (benchmarks/edge_touches.py). The second one to be exact.
# Tables keep FINE: with this one, in a trial, one took twice as long and served fewer touches.
ONE_EDGE = Resolution(4.0, 12, 16, widest=1.0, parts=4, inside=0.0, grading=0.4)
ONE_EDGE_FINER = Resolution(3.0, 16, 22, parts=4, inside=0.0, grading=0.3)
# Strains in plane, steep next to the punch and where the foam's side is free, are half to three quarters as far off as
# by FINE, 10 to 2 mm from an edge (benchmarks/edge_touches.py).
FULL_DISC = Resolution(3.0, 9, 18, np.inf, widest=0.25, parts=4, inside=0.12)
Finenesses = tuple[Resolution | None, Resolution, Resolution]  # rough, coarse, fine; the first where it may serve


@dataclass(frozen=True, eq=False)
class Solution:
    """What the rim adds on one mesh."""

    disc: ClippedDisc
    model: IndentationProblem
    state: Equilibrium
    # (unknowns + 1,) what the rim adds
    x: Array
    residuals: tuple[float, ...]


@dataclass(frozen=True)
class Load:
    """What is given: the force over mu_0 H^2, or else the depth over H."""

    force: float | None
    depth: float | None

    def state(self, model: IndentationProblem, coefficient: float) -> tuple[IndentationProblem, Equilibrium]:
        """The problem with what holds the foam there, and its equilibrium; ValueError where nothing is given."""
        if self.force is not None:
            if not coefficient:
                return model, solve_axisymmetric.under_force([model], self.force)[0]
            with bounded(friction_increments.FACTORISATIONS, model.grid.unknowns):
                rest = friction_increments.at_rest(model)
                _, found = friction_increments.loaded(model, coefficient, rest, self.force)
        elif self.depth is not None:
            (state,) = solve_axisymmetric.at_depth([model], self.depth)
            if not coefficient:
                return model, state
            with bounded(friction_increments.FACTORISATIONS, model.grid.unknowns):
                _, found = friction_increments.at_depth_of(model, coefficient, self.depth, state.force)
        else:
            raise ValueError("a punch needs force_N or depth_m, got neither.")
        return replace(model, springs=found.springs), found.state

    def halved(self) -> Load:
        return Load(*(None if part is None else part / 2 for part in (self.force, self.depth)))


def near_rim_on_two_meshes(law: Law, body: Body, punch: Punch, *, finer: bool = False, whole: bool = False,
                           all_edges: bool = False) -> TwoMeshes:
    """Equilibrium near the rim, or near an edge of an outline, under the punch's force or at its depth: the
    axisymmetric touch, and what the rim adds. Of an outline the nearest edge alone counts, as part of the rim of a disc
    (see `eitsim.scene.nearest_edge`), on a finer mesh than a rim; or with all_edges the whole of it, corners and holes
    too, at twice the cost and more. finer: the axisymmetric touch on elements of half the size; whole: what the rim
    adds, too, on finer meshes and, on a disc, out to all of it. The punch's edge lies on the skin, and the punch slips
    freely, sticks or rubs. NotConverged where no equilibrium is found."""
    outlined = not body.edge.is_round
    edge, one_edge = edges_from(body, punch) if all_edges and outlined else None, outlined and not all_edges
    touch = solve_touch(law, body, punch, element_m=default_element_m(body, punch) / 2 if finer or whole else None)
    if not whole:
        return on_two_meshes(touch, law, body, punch, edge=edge, fine=ONE_EDGE if one_edge else FINE,
                             rough=None if edge else ROUGH)
    fine = replace(FULL_DISC, out_to=FINE.out_to) if outlined else FULL_DISC
    return on_two_meshes(touch, law, body, punch, coarse=FINE, edge=edge, fine=ONE_EDGE_FINER if one_edge else fine)


def edges_from(body: Body, punch: Punch) -> OffsetOutline:
    """All edges of an outline seen from a punch, m; those of a polygon in place of a disc."""
    place, (start, end) = np.array([punch.x_m, punch.y_m]), corners_and_edges(body.edge)
    return OffsetOutline(start - place, end - place)


def on_a_disc(body: Body, punch: Punch) -> tuple[Body, Punch]:
    """A disc of an outline's area, and the punch on it as far from its rim, in the same direction, as from the nearest
    edge; a disc as it is."""
    if body.edge.is_round:
        return body, punch
    edge = body.edge.nearest((punch.x_m, punch.y_m))
    x, y = ((body.edge.size_m - edge.distance_m) * edge.towards).tolist()
    return Body(Disc(body.edge.size_m), body.thickness_m), replace(punch, x_m=x, y_m=y)


def on_two_meshes(touch: Touch, law: Law, body: Body, punch: Punch, *, coarse: Resolution = COARSE,
                  fine: Resolution = FINE, rough: Resolution | None = None,
                  edge: OffsetDisc | OffsetOutline | None = None) -> TwoMeshes:
    """An axisymmetric touch with the rim's effect, of finenesses whose difference gives the error; NotConverged, with
    the likely cause, where no equilibrium is found. rough: with coarse in place of coarse with fine where fine takes
    too long. edge: the rim of another disc, m, in place of the body's, or all edges of an outline."""
    cause = _likely_cause(touch, body, punch)
    try:
        return replace(_corrected(touch, law, body, punch, (rough, coarse, fine), edge), problem=cause)
    except NotConverged as error:
        raise NotConverged(f"{error} {cause}", estimate=error.estimate,
                           residuals=error.residuals, load_fraction=error.load_fraction) from None


def _likely_cause(touch: Touch, body: Body, punch: Punch) -> str:
    gap = rim_gap_m(body, punch)
    lost = (f"strong ellipticity is lost at {touch.fraction_non_elliptic:.1%} of the points of the foam, and "
            if touch.fraction_non_elliptic else "")
    return (f"Likely cause: {lost}the punch's edge is {gap * 1e3:.2f} mm from the rim, {touch.depth_m * 1e3:.2f} mm "
            "deep, and squeezes the foam's free side out; move it inwards or press less.")


def _corrected(touch: Touch, law: Law, body: Body, punch: Punch, finenesses: Finenesses,
               given: OffsetDisc | OffsetOutline | None) -> TwoMeshes:
    started = cpu_s()
    disc, on_disc = on_a_disc(body, punch)
    if disc is not body:
        edge = body.edge.nearest((punch.x_m, punch.y_m))
        meshes = _added(touch, law, disc, on_disc, given or OffsetDisc(edge.disc_m, edge.offset_m), finenesses)
        found = meshes.touch
        assert found.volume is not None
        towards = edge.towards if given is None else np.array([1.0, 0.0])
        edges = edges_from(body, punch)
        volume = replace(found.volume, axis_m=np.array([punch.x_m, punch.y_m]),
                         bearing_rad=math.atan2(towards[1], towards[0]), edges_m=np.stack([edges.start, edges.end], 1))
        return replace(meshes, touch=replace(found, rim=replace(meshes.fine, towards=towards), volume=volume,
                                             cpu_s=touch.cpu_s + cpu_s() - started))
    outline = given or OffsetDisc(body.radius_m, math.hypot(punch.x_m, punch.y_m))
    meshes = _added(touch, law, body, punch, outline, finenesses)
    return replace(meshes, touch=replace(meshes.touch, cpu_s=touch.cpu_s + cpu_s() - started))


def _added(touch: Touch, law: Law, body: Body, punch: Punch, outline: OffsetDisc | OffsetOutline,
           finenesses: Finenesses) -> TwoMeshes:
    """The touch with what the rim of an outline, m, adds; its signals are compared on the body, a disc."""
    before, after, left = _pair(law, body, punch, outline, *finenesses)
    coarser, change = change_of(before, body), change_of(after, body)
    change = replace(change, residuals=coarser.residuals + change.residuals)
    edges = (outline.start, outline.end) if isinstance(outline, OffsetOutline) else None
    out = with_error(touch, coarser, change, body, punch, edges, left)
    volume = volume_of(after.disc, outline.scaled(1 / body.thickness_m), after.model, after.state, after.x, law,
                       body.thickness_m, np.array([punch.x_m, punch.y_m]), math.atan2(punch.y_m, punch.x_m))
    return replace(out, touch=replace(out.touch, volume=volume), part=0.0 if punch.friction == "none" else _WAY)


def _pair(law: Law, body: Body, punch: Punch, outline: OffsetDisc | OffsetOutline, rough: Resolution | None,
          coarse: Resolution, fine: Resolution) -> tuple[Solution, Solution, float]:
    """Solutions of neighbouring finenesses, the finer one last, and its error over their difference. The rough one is
    found on its own, since there are several equilibria where the foam folds, and the difference shows that too."""
    found = _found(law, body, punch, outline, coarse)
    if rough is None:
        return found, _found(law, body, punch, outline, fine, found), UNCONVERGED
    if len(found.residuals) <= _HARD:
        with suppress(NotConverged):
            return found, _found(law, body, punch, outline, fine, found), UNCONVERGED
    return _found(law, body, punch, outline, rough), found, _ROUGHLY


def rim_change(law: Law, body: Body, punch: Punch, fineness: Resolution = FINE,
               edge: OffsetDisc | OffsetOutline | None = None) -> RimCorrection:
    """What the rim changes of the touch under the punch's force or at its depth; edge: the rim of another disc, m, in
    place of the body's, or all edges of an outline. Radii and angles of the field depend on the body, the punch's size
    and shape and the fineness alone, so that fields of several forces and places on the disc interpolate point by
    point. NotConverged where no equilibrium is found."""
    return next(rim_changes(law, body, punch, (fineness,), edge))


def rim_changes(law: Law, body: Body, punch: Punch, finenesses: Iterable[Resolution],
                edge: OffsetDisc | OffsetOutline | None = None) -> Iterator[RimCorrection]:
    """As `rim_change`, on meshes one after the other, each from the solution on the one before."""
    outline = edge or OffsetDisc(body.radius_m, math.hypot(punch.x_m, punch.y_m))
    found = None
    for fineness in finenesses:
        found = _found(law, body, punch, outline, fineness, found)
        yield change_of(found, body)


def change_of(solution: Solution, body: Body) -> RimCorrection:
    """What a solution changes of the axisymmetric touch, with its field on the whole top of the body."""
    disc, unit = solution.disc, body.thickness_m
    at, added = samples(disc, solution.model, disc.outline), amplitudes(disc, solution.x[:-1])
    alone, whole = (deformation(at.points, a) for a in (disc.base, disc.base + added))
    return correction_of(solution, field(at, alone, whole, displacement(at.points, added), unit), unit)


def correction_of(solution: Solution, field: RimField, unit: float) -> RimCorrection:
    """What a solution changes of the axisymmetric touch, with its field; a thickness is `unit`, m."""
    disc, x = solution.disc, solution.x
    return RimCorrection(field, float(x[-1]) * unit, *contact_ratios(disc, x), fraction_non_elliptic(disc, x),
                         solution.residuals, _force_ratio(solution) if disc.held else 1.0)


def _force_ratio(solution: Solution) -> float:
    """Force over the axisymmetric one at the same depth; the contact's penetration, which both are corrected for, goes
    with the force."""
    state, ratio = solution.state, reaction(solution.disc, solution.x) / solution.disc.force
    penetration = float(state.x[-1]) - state.depth
    return ratio - (1 - ratio) * penetration / float(state.by_force[-1] * state.force)


def _found(law: Law, body: Body, punch: Punch, outline: OffsetDisc | OffsetOutline, fineness: Resolution,
           before: Solution | None = None) -> Solution:
    """The solution in an outline, m, from the axisymmetric state, or from one on another mesh; else by way of half the
    load."""
    model, load = set_up(law, body, punch, fineness)
    return _under(model, load, friction.coefficient(punch), outline.scaled(1 / body.thickness_m), fineness, before,
                  _HALVINGS)


def set_up(law: Law, body: Body, punch: Punch, fineness: Resolution) -> tuple[IndentationProblem, Load]:
    """The discretised foam under a punch, without friction, and what is given."""
    unit, smooth = body.thickness_m, replace(punch, friction="none")
    model = mesh_hierarchy(law, body, smooth, fineness.element * default_element_m(body, punch), None, even=0.0)[-1]
    load = Load(None if punch.force_N is None else punch.force_N / solve_axisymmetric.force_unit(law, body),
                None if punch.force_N is not None or punch.depth_m is None else punch.depth_m / unit)
    return _narrowed(model, fineness), load


def _narrowed(model: IndentationProblem, fineness: Resolution) -> IndentationProblem:
    """The problem with elements split about the punch's edge, and none wider than the widest as far as the change
    reaches."""
    r, z = (lines[::model.grid.order] for lines in model.grid.lines)
    edge, fillet = model.punch.profile.radius, model.punch.profile.edge_radius
    steep = (r[:-1] > edge - fineness.inside - _NEAR) & (r[1:] < edge + _OUTSIDE)
    far = [max(b - edge, edge - fillet - a) for a, b in itertools.pairwise(r.tolist())]
    parts = [max(math.ceil((b - a) / _widest(fineness, away)), fineness.parts if split else 1)
             if a < edge + fineness.out_to else 1
             for (a, b), split, away in zip(itertools.pairwise(r), steep, far, strict=True)]
    r = np.concatenate([[0.0], *(a + (b - a) * np.arange(1, n + 1) / n
                                 for (a, b), n in zip(itertools.pairwise(r), parts, strict=True))])
    grid = tensor_grid(r, z, order=model.grid.order)
    last = model.grid.nodes[model.facets.nodes[-1, -1], 0]
    return replace(model, grid=grid, facets=top_facets(grid, last - _NEAR))


def _widest(fineness: Resolution, away: float) -> float:
    """The widest parts, thicknesses, of an element whose farther end is so far away from the punch's fillet; negative
    or 0: within it."""
    return min(fineness.widest, fineness.grading * away) if away > _NEAR else fineness.widest


def _under(model: IndentationProblem, load: Load, coefficient: float, outline: OffsetDisc | OffsetOutline,
           fineness: Resolution, before: Solution | None, halvings: int) -> Solution:
    model, state = load.state(model, coefficient)
    disc = clipped_disc(model, state, outline, fineness.harmonics, fineness.angles,
                        model.punch.profile.radius + fineness.out_to, held=load.force is None)
    with bounded(FACTORISATIONS, disc.unknowns):
        for start in (None if before is None else carried_over(before, disc, model), None):
            try:
                found = solve(disc, start)
                return Solution(disc, model, state, found.x, found.residuals)
            except NotConverged:
                if halvings == 0:
                    raise
        half = _under(model, load.halved(), coefficient, outline, fineness, None, halvings - 1)
        found = solve(disc, half.x)
        return Solution(disc, model, state, found.x, half.residuals + found.residuals)


def carried_over(before: Solution, disc: ClippedDisc, model: IndentationProblem) -> Array:
    """A solution's unknowns on another disc: what the rim adds at the new nodes, in as many harmonics as both have."""
    old, count = before.disc, min(len(before.disc.fixed), len(disc.fixed))
    along_r = interpolation(old.columns, disc.columns, old.order)
    along_r[disc.columns > old.columns[-1]] = 0.0
    along_z = interpolation(before.model.grid.lines[1], model.grid.lines[1], old.order)
    added = amplitudes(old, before.x[:-1])[..., :count].reshape(len(old.columns), -1, 3 * count)
    out = np.zeros(disc.base.shape)
    out[..., :count] = np.einsum("im,mnk,jn->ijk", along_r, added, along_z, optimize=True).reshape(-1, 3, count)
    return np.append(unknowns_of(disc, out), before.x[-1])
