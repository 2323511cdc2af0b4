"""Two touches that meet, solved together in three dimensions: a pass over each in turn, until nothing changes.

Each punch has a frame of its own, in which its field is the axisymmetric state and an added Fourier series about its
axis (`eitsim.mechanics.harmonics.clipped_disc`, unclipped). With F_1, F_2 the gradients of both fields alone and F =
F_1 + F_2 - 1, the stress P(F) is split at the plane in the middle of the gap: frame 1 balances P(F) - P(F_2) in its
half and P(F_1) in the other, frame 2 the mirror image, so that the sum is P(F) everywhere and neither series has to
follow the other's edge. Solving either frame with the other's field given, as in Schwarz's method, and both at once, a
pass, leads there. Near edges both frames have all of them and whole turns; integrals over the skin alone leave its
edges free.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.axisymmetric.indentation import IndentationProblem
from eitsim.mechanics.harmonics.arcs import OffsetDisc
from eitsim.mechanics.harmonics.clipped_disc import ClippedDisc, CutVolumeQuadrature, amplitudes, clipped_disc
from eitsim.mechanics.harmonics.equilibrium import reaction, solve
from eitsim.mechanics.rim.axis_transfer import AxisTransfer, view, view_all_around
from eitsim.mechanics.rim.clipped_surface import Plane, deformation, displacement, field, samples
from eitsim.mechanics.rim.correction import RimCorrection, TwoMeshes, with_error
from eitsim.mechanics.rim.interaction import edge_gap_m
from eitsim.mechanics.rim.solve_near_rim import (
    COARSE,
    FINE,
    Resolution,
    Solution,
    carried_over,
    correction_of,
    edges_from,
    on_a_disc,
    set_up,
)
from eitsim.mechanics.solid import spatial_response
from eitsim.numerics.newton import Minimum
from eitsim.scene.edges.disc import Disc
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Punch
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

# Least gap between the edges, thicknesses, at which pairs were solved.
LEAST_GAP = 0.3
# Relative change of depths and forces at which the passes end, and the most passes.
_SETTLED, _PASSES = 1e-4, 20
# Least part of the other's field by which it is added where all of it at once leads nowhere.
_LEAST_PART = 1 / 32
_FIX = "Try smaller forces or a larger gap."
# Radius, thicknesses, of the disc whose rim stands for the plane in the middle.
_PLANE = 1e5
# How far past that plane the surface is sampled for interpolation up to it, thicknesses, at most.
_PAST = 0.3
# The finest that is offered, for exact runs.
FINEST = Resolution(3.0, 9, 18)


@dataclass(frozen=True, eq=False)
class _Frame:
    """One punch of two, and how the other's field is seen from it; lengths in thicknesses."""

    alone: Solution  # the touch alone on the frame's mesh, nothing added
    # distance of the plane in the middle from the punch's axis, and of the other axis
    half: float
    separation: float
    towards: Array  # (2,) direction to the other axis, on a whole turn from the x axis
    near: NDArray[np.bool_]  # (points, angles) whether a point of the foam lies in this punch's half
    # those points, and all (facets points x angles) of the surface that the punch may touch, seen from the other
    foam: AxisTransfer
    surface: AxisTransfer

    @property
    def disc(self) -> ClippedDisc:
        return self.alone.disc

    @property
    def model(self) -> IndentationProblem:
        return self.alone.model


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two frames and what is added in each."""

    frames: tuple[_Frame, ...]
    discs: tuple[ClippedDisc, ...]  # the frames' discs with the other's field
    x: tuple[Array, ...]  # (unknowns + 1,) each
    # largest relative change of depths and forces by the last pass
    moved: float
    residuals: tuple[float, ...]


def pair_on_two_meshes(touches: Sequence[Touch], law: Law, body: Body, punches: Sequence[Punch], *,
                       coarse: Resolution = COARSE, fine: Resolution = FINE, edges: bool = False) -> list[TwoMeshes]:
    """Two axisymmetric touches with what each changes of the other, far from the rim, symmetric about the line through
    both axes; or with what all edges change, too, at several times the cost. Two finenesses and the last pass give the
    errors. Both punches slip freely, LEAST_GAP or more from each other. NotConverged where no equilibrium is found."""
    started = cpu_s()
    rough = _settled(_frames(law, body, punches, coarse, edges))
    found = _settled(_frames(law, body, punches, fine, edges), rough)
    spent, out = (cpu_s() - started) / 2, []
    for i, (touch, (disc, punch)) in enumerate(zip(touches, _on_discs(body, punches, edges), strict=True)):
        around = edges_from(body, punches[i])
        one = with_error(touch, _change(rough, i, body, punches), _change(found, i, body, punches), disc, punch,
                         (around.start, around.end) if edges else None)
        out.append(replace(one, settled=found.moved, touch=replace(
            one.touch, depth_error=one.touch.depth_error + found.moved, cpu_s=touch.cpu_s + spent)))
    return out


def _on_discs(body: Body, punches: Sequence[Punch], edges: bool) -> list[tuple[Body, Punch]]:
    """The disc on which errors of signals are found, and each punch there: of an outline far from edges about the
    middle of both, near them as far from the rim."""
    if edges or not body.has_outline:
        return [on_a_disc(body, punch) for punch in punches]
    x, y = (sum(getattr(punch, axis) for punch in punches) / len(punches) for axis in ("x_m", "y_m"))
    disc = Body(Disc(body.edge.size_m), body.thickness_m)
    return [(disc, replace(punch, x_m=punch.x_m - x, y_m=punch.y_m - y)) for punch in punches]


def _frames(law: Law, body: Body, punches: Sequence[Punch], fineness: Resolution,
            edges: bool) -> tuple[_Frame, ...]:
    unit = body.thickness_m
    gap = edge_gap_m(*punches) / unit
    parts = []
    for punch in punches:
        model, load = set_up(law, body, punch, fineness)
        model, state = load.state(model, 0.0)
        outline = edges_from(body, punch).scaled(1 / unit) if edges else OffsetDisc(_PLANE, 0.0)
        disc = clipped_disc(model, state, outline, fineness.harmonics, fineness.angles,
                            model.punch.profile.radius + fineness.out_to, held=load.force is None)
        parts.append(Solution(disc, model, state, np.zeros(disc.unknowns + 1), ()))
    separation = gap + sum(part.model.punch.profile.radius for part in parts)
    there = np.array([punches[1].x_m - punches[0].x_m, punches[1].y_m - punches[0].y_m])
    towards = there / np.linalg.norm(there) if edges else np.array([1.0, 0.0])
    ways = (towards, -towards if edges else towards)
    return tuple(_frame(own, other, separation, gap, way)
                 for own, other, way in zip(parts, parts[::-1], ways, strict=True))


def _frame(alone: Solution, other: Solution, separation: float, gap: float, towards: Array) -> _Frame:
    model, disc = alone.model, alone.disc
    half = model.punch.profile.radius + gap / 2
    angles = disc.weight.shape[1]
    at = disc.foam.shape[..., 2]
    radius = 1 / at.sum(axis=1)
    height = radius * np.sum(at * model.grid.nodes[disc.foam.nodes, 1], axis=1)
    radii, circle = np.unique(np.round(radius, 10), return_inverse=True)
    angle = disc.outline.sampled(radii, angles)[0][circle]
    near = radius[:, None] * (np.cos(angle) * towards[0] + np.sin(angle) * towards[1]) < half
    where = np.broadcast_arrays(radius[:, None], angle, height[:, None])
    foam = _seen(other, separation * towards, *(part[near] for part in where))
    around = disc.outline.sampled(disc.facing.radius[:, 0], angles)[0]
    under = np.broadcast_to(disc.facing.radius, around.shape)
    surface = _seen(other, separation * towards, under.ravel(), around.ravel(), np.zeros(under.size))
    return _Frame(alone, half, separation, towards, near, foam, surface)


def _seen(other: Solution, away: Array, radius: Array, angle: Array, height: Array) -> AxisTransfer:
    """Points (n,) about one axis seen from the other, which lies at x and y (2,) from it."""
    disc, rows = other.disc, other.model.grid.lines[1]
    if disc.outline.whole_turn:
        return view_all_around(disc.columns, rows, len(disc.fixed), away, radius, angle, height)
    return view(disc.columns, rows, len(disc.fixed), float(np.linalg.norm(away)), radius, angle, height)


def _settled(frames: tuple[_Frame, ...], before: _Pair | None = None) -> _Pair:
    """Passes over both frames, from another pair's solution or from the touches alone, until nothing changes."""
    x = tuple(f.alone.x for f in frames) if before is None else tuple(
        carried_over(replace(b.alone, x=old), f.disc, f.model)
        for f, b, old in zip(frames, before.frames, before.x, strict=True))
    outside, last, residuals = [None, None], None, ()
    for _ in range(_PASSES):
        fields = [f.disc.base + amplitudes(f.disc, part[:-1]) for f, part in zip(frames, x, strict=True)]
        given = [_outside(f, field) for f, field in zip(frames, fields[::-1], strict=True)]
        found = [_met(f.disc, *of) for f, of in zip(frames, zip(outside, given, x, strict=True), strict=True)]
        outside, x = given, tuple(one.x for one in found)
        discs = tuple(replace(f.disc, outside=one) for f, one in zip(frames, outside, strict=True))
        now = np.array([(disc.depth + part[-1], reaction(disc, part)) for disc, part in zip(discs, x, strict=True)])
        moved = np.inf if last is None else float(np.abs(now / last - 1).max())
        last, residuals = now, residuals + tuple(r for one in found for r in one.residuals)
        if moved < _SETTLED:
            return _Pair(frames, discs, x, moved, residuals)
    raise NotConverged(f"two touches solved in turn still change each other by {moved:.1e} after {_PASSES} passes. "
                       f"{_FIX}", residuals=residuals)


def _outside(frame: _Frame, field: Array) -> CutVolumeQuadrature:
    """The other's field (nodes, 3, harmonics) in this punch's half."""
    grad_u = np.zeros((*frame.near.shape, 9))
    grad_u[frame.near] = frame.foam.gradient(field)
    shift = frame.surface.displacement(field).reshape(*frame.disc.facing.weight.shape, 3)
    return _stressed(frame.disc, np.ascontiguousarray(np.moveaxis(grad_u, 2, 1)),
                     np.ascontiguousarray(np.moveaxis(shift, 2, 1)))


def _stressed(disc: ClippedDisc, grad_u: Array, shift: Array) -> CutVolumeQuadrature:
    stress, _ = spatial_response.stress_and_tangent(disc.law, spatial_response.principal(grad_u), disc.weight)
    return CutVolumeQuadrature(grad_u, stress, shift)


def _met(disc: ClippedDisc, before: CutVolumeQuadrature | None, after: CutVolumeQuadrature, start: Array) -> Minimum:
    """The disc's equilibrium with a field from outside; in parts, where needed, from the field that `start` belongs to
    or from none."""
    try:
        return solve(replace(disc, outside=after), start)
    except NotConverged:
        if before is None:
            before, start = _stressed(disc, 0 * after.displacement_gradient, 0 * after.shift), 0 * start
    reached, part = 0.0, 0.5
    while True:
        share = reached + part
        given = after if share == 1 else _stressed(
            disc, before.displacement_gradient + share * (after.displacement_gradient - before.displacement_gradient),
            before.shift + share * (after.shift - before.shift))
        try:
            found = solve(replace(disc, outside=given), start)
        except NotConverged as error:
            if part <= _LEAST_PART:
                raise NotConverged(f"two touches solved together: {error} {_FIX}", estimate=error.estimate,
                                   residuals=error.residuals, load_fraction=reached) from None
            part /= 2
            continue
        reached, start = share, found.x
        if reached == 1:
            return found


def _change(pair: _Pair, i: int, body: Body, punches: Sequence[Punch]) -> RimCorrection:
    there = np.array([punches[1 - i].x_m - punches[i].x_m, punches[1 - i].y_m - punches[i].y_m])
    found = replace(pair.frames[i].alone, disc=pair.discs[i], x=pair.x[i], residuals=pair.residuals)
    towards = there / np.linalg.norm(there)
    return correction_of(found, _surface_field(pair, i, body.thickness_m, towards), body.thickness_m)


def _surface_field(pair: _Pair, i: int, unit: float, towards: Array) -> RimField:
    """What both touches change on top of their sum: displacement, and the metric and the normal stretch that this touch
    must have so that, with the other's alone, they are those of the whole."""
    frame, theirs = pair.frames[i], pair.frames[1 - i]
    added, other_added = (amplitudes(pair.frames[k].disc, pair.x[k][:-1]) for k in (i, 1 - i))
    middle, outline = OffsetDisc(_PLANE, _PLANE - frame.half), frame.disc.outline
    plane = Plane(towards, frame.half, middle, min(_PAST, (frame.half - frame.model.punch.profile.radius) / 2))
    at = samples(frame.disc, frame.model, *((outline, plane) if outline.whole_turn else (middle, None)))
    flat = np.broadcast_to(at.radius[:, None], at.angle.shape).ravel()
    seen = _seen(theirs.alone, frame.separation * frame.towards, flat, at.angle.ravel(), np.zeros(flat.size))

    def others(amplitude: Array) -> Array:
        return seen.gradient(amplitude).reshape(*at.angle.shape, 3, 3)

    alone, neighbour = deformation(at.points, frame.disc.base), np.eye(3) + others(theirs.disc.base)
    whole = deformation(at.points, frame.disc.base + added) + others(theirs.disc.base + other_added)
    moved = displacement(at.points, added) + seen.displacement(other_added).reshape(*at.angle.shape, 3)
    return field(at, alone, whole, moved, unit, neighbour, towards)
