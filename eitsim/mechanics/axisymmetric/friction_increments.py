"""A touch with friction, loaded in increments: what the foam has stuck to and slipped over depends on the way there.

Each increment minimises an energy in which the springs of `eitsim.mechanics.contact.friction` are linear about an
estimate of its end, and again about that end: in one pass along the tangent of the increment before, by Coulomb's law
and at the forces that are asked for until the depth settles. A point that comes into contact during an increment holds
where it touched, its way over the increment taken as straight. It stays held until no point of its facet touches, and
lets go after the increment. The way is solved on a coarse mesh, and its last increment again on a fine one. The error
of the increments is the change from half as many, which a first order leaves.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.axisymmetric import indentation
from eitsim.mechanics.axisymmetric.continuation import cold_start, load_continuation
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem, equilibrium, nearest, seen
from eitsim.mechanics.contact import friction
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.friction import FrictionState, Nearest
from eitsim.numerics.work_budget import bounded, used_up
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Increments of the coarse mesh from rest to a force, by default; another force is reached in as large ones.
INCREMENTS = 32
# Relative change of the depth at which a slipping increment, and one whose end is asked for, need no further pass.
_SLIPPED, _SETTLED = 1e-3, 1e-5
# Relative residuals of the increments that are asked for and of those on the way.
_EXACT, _ROUGH = 1e-10, 1e-6
# Most passes, and those after which two estimates of the largest shear are averaged.
_PASSES, _FREE_PASSES = 10, 3
# How often an increment is halved where no equilibrium is found, and the iterations after which none is.
_HALVINGS, _ITERATIONS = 4, 60
# A prescribed depth: relative error at which it is reached, and steps towards it.
_DEPTH_TOLERANCE, _DEPTH_STEPS = 1e-6, 20
# The depth jumps by a few times _SETTLED between forces, closer than _SAME_FORCE of each other, that take one pass more
# or less: largest relative miss that then counts as unsettled.
_SAME_FORCE, _JUMP = 1e-9, 1e-4
# Factorisations on the fine mesh whose work a course may take: the dearest random scene takes 320.
FACTORISATIONS = 1600


@dataclass(frozen=True)
class Loaded:
    """Foam at the end of an increment, and what its contact remembers."""

    state: Equilibrium
    anchor: Array  # (facets, points) arc of the punch at which a point is held; not a number where none is
    springs: FrictionState  # the springs of the last minimisation, which hold nothing at rest
    unsettled: float  # relative change of the depth in the last pass; infinite after one pass
    slipping: float  # part of the reference area in contact that slips
    dissipated: float  # energy lost to slip since rest, over mu_0 H^3


@dataclass(frozen=True)
class FrictionHistory:
    """One end of a way of loading."""

    rough: Loaded  # on the coarse mesh in half as many increments
    coarse: Loaded  # on the coarse mesh
    fine: Loaded  # on the fine mesh: the last increment, with the anchors of the coarse one


def at_rest(model: IndentationProblem) -> Loaded:
    """Foam that was never touched."""
    x = np.zeros(model.grid.unknowns + 1)
    none = np.zeros(model.facets.weight.shape)
    free = FrictionState(friction.stiffness(model.punch), none, none, seen(model, x), nearest(model, x).along)
    return Loaded(Equilibrium(x, x, 0.0, 0.0, ()), np.full(none.shape, np.nan), free, 0.0, 0.0, 0.0)


def under_forces(coarse: IndentationProblem, fine: IndentationProblem, coefficient: float, forces: Sequence[float],
                 count: int = INCREMENTS) -> Iterator[FrictionHistory]:
    """The course to each force, loaded in this order, each in so many increments."""
    rough = now = at_rest(coarse)
    for force in forces:
        with bounded(FACTORISATIONS, fine.grid.unknowns):
            _, rough = loaded(coarse, coefficient, rough, force, count // 2)
            last, now = loaded(coarse, coefficient, now, force, count)
            course = FrictionHistory(rough, now, _carried_over(coarse, last, now, fine, coefficient))
        yield course


def at_depth(coarse: IndentationProblem, fine: IndentationProblem, coefficient: float, depth: float, guess: float,
             count: int = INCREMENTS) -> FrictionHistory:
    """The course, in so many increments, to a corrected depth that a force near `guess`, above it rather than below,
    leads to."""
    with bounded(FACTORISATIONS, fine.grid.unknowns):
        rough = at_depth_of(coarse, coefficient, depth, guess, count // 2)[1]
        last, now = at_depth_of(coarse, coefficient, depth, guess, count)
        near = _carried_over(coarse, last, now, fine, coefficient)
        return FrictionHistory(rough, now, _reached(fine, coefficient, _on(coarse, last, fine), near, depth))


def at_depth_of(model: IndentationProblem, coefficient: float, depth: float, guess: float,
                count: int = INCREMENTS) -> tuple[Loaded, Loaded]:
    """The foam of one mesh under the force `guess` and, one increment from there, at a corrected depth."""
    end = loaded(model, coefficient, at_rest(model), guess, count)[1]
    return end, _reached(model, coefficient, end, end, depth)


def loaded(model: IndentationProblem, coefficient: float, before: Loaded, force: float,
           count: int = INCREMENTS) -> tuple[Loaded, Loaded]:
    """The foam before the last increment and under a force, in increments of 1/count of it or of the force before,
    whichever is larger. NotConverged carries the part of the force that was reached."""
    start, last = before.state.force, before
    steps = max(math.ceil(count * abs(force - start) / max(force, start) - 1e-9), 1)
    for k in range(1, steps + 1):
        target, last = force if k == steps else start + (force - start) * k / steps, before
        try:
            before = _in_halves(model, coefficient, before, target, settle=k == steps)
        except NotConverged as error:
            share = before.state.force / force
            raise NotConverged(f"{error} The last equilibrium with friction held {share:.1%} of the force.",
                               estimate=error.estimate, residuals=error.residuals, load_fraction=share) from None
    return last, before


def at_force(model: IndentationProblem, coefficient: float, before: Loaded, force: float) -> Loaded:
    """The foam under a force, one increment from the state before; of a problem that a step in time changes, the force
    may be the one before."""
    if force == before.state.force:
        return increment(model, coefficient, before, force, before.state.x, settle=True)
    return _in_halves(model, coefficient, before, force, settle=True)


def _carried_over(coarse: IndentationProblem, last: Loaded, now: Loaded, fine: IndentationProblem,
                  coefficient: float) -> Loaded:
    """The foam of a coarse mesh on a finer one, the last increment made again; loaded from rest where that fails."""
    try:
        return increment(fine, coefficient, _on(coarse, last, fine), now.state.force,
                         indentation.transferred(now.state.x, coarse.grid, fine.grid), settle=True)
    except NotConverged:
        return loaded(fine, coefficient, at_rest(fine), now.state.force)[1]


def _on(coarse: IndentationProblem, loaded: Loaded, fine: IndentationProblem) -> Loaded:
    x, by_force = (indentation.transferred(v, coarse.grid, fine.grid) for v in (loaded.state.x, loaded.state.by_force))
    held = ~np.isnan(loaded.anchor)
    anchor = np.full(fine.facets.weight.shape, np.nan)
    if np.any(held):
        radius = coarse.facets.radius[held]
        anchor = fine.facets.radius + np.interp(fine.facets.radius, radius, loaded.anchor[held] - radius, right=np.nan)
    anchor[~np.any(nearest(fine, x).penetration > 0, axis=1)] = np.nan
    return replace(loaded, state=replace(loaded.state, x=x, by_force=by_force), anchor=anchor)


def _in_halves(model: IndentationProblem, coefficient: float, before: Loaded, force: float, *, settle: bool,
               halvings: int = _HALVINGS) -> Loaded:
    """The foam after an increment, or after two of half of it where that fails."""
    for ahead in (True, False) if before.state.force > 0 else (False,):
        try:
            return increment(model, coefficient, before, force, _estimate(model, before, force, ahead), settle=settle)
        except NotConverged:
            if used_up() or (halvings == 0 and not ahead):
                raise
    middle = (before.state.force + force) / 2
    half = _in_halves(model, coefficient, before, middle, settle=False, halvings=halvings - 1)
    return _in_halves(model, coefficient, half, force, settle=settle, halvings=halvings - 1)


def _estimate(model: IndentationProblem, before: Loaded, force: float, ahead: bool) -> Array:
    """End of an increment, along the tangent at its start or as its start; from rest without friction."""
    state = before.state
    if state.force == 0:
        return cold_start(model, force).x
    return state.x + state.by_force * (force - state.force) if ahead else state.x


def increment(model: IndentationProblem, coefficient: float, before: Loaded, force: float, x: Array, *,
              settle: bool) -> Loaded:
    """The foam under a force from the state before, its end estimated by x; settle: passes until the depth stays."""
    sticks = np.isinf(coefficient)
    settled, passes = _SETTLED if settle else _SLIPPED, 1 if sticks and not settle else _PASSES
    tolerance = _EXACT if settle else _ROUGH
    held = ~np.isnan(before.anchor)
    springs = gripped(model, coefficient, before, x, held)
    state = equilibrium(replace(model, springs=springs), force, x, _ITERATIONS, tolerance)
    change, spent = np.inf, ()
    for k in range(1, passes):
        held, spent, last = held | (springs.limit > 0), spent + state.residuals, springs
        springs = gripped(model, coefficient, before, state.x, held)
        if k >= _FREE_PASSES and not sticks:
            springs = replace(springs, limit=(springs.limit + last.limit) / 2)
        depth, state = state.depth, equilibrium(replace(model, springs=springs), force, state.x, _ITERATIONS, tolerance)
        change = abs(depth / state.depth - 1)
        if change <= settled:
            break
    return _let_go(model, before, replace(state, residuals=spent + state.residuals), springs,
                   held | (springs.limit > 0), change)


def gripped(model: IndentationProblem, coefficient: float, before: Loaded, x: Array,
            held: NDArray[np.bool_]) -> FrictionState:
    """Springs about x, held where it touches or `held` says."""
    at = nearest(model, x)
    if np.isinf(coefficient):
        limit = np.where((at.penetration > 0) | held, np.inf, 0.0)
    else:
        limit = coefficient * contact.pressure(model.punch, np.maximum(at.penetration, 0.0))
    slip = at.arc - _anchors(nearest(model, before.state.x), at, before.anchor)
    return FrictionState(friction.stiffness(model.punch), limit, slip, seen(model, x), at.along)


def _anchors(old: Nearest, new: Nearest, anchor: Array) -> Array:
    """Anchors (facets, points), where there are none the arc at which a straight way from old to new met the punch."""
    rise = new.penetration - old.penetration
    met = (new.penetration > 0) & (rise > 0)
    share = np.where(met, np.clip(-old.penetration / np.where(met, rise, 1.0), 0.0, 1.0), 1.0)
    return np.where(np.isnan(anchor), old.arc + share * (new.arc - old.arc), anchor)


def _let_go(model: IndentationProblem, before: Loaded, state: Equilibrium, springs: FrictionState,
            held: NDArray[np.bool_], change: float) -> Loaded:
    """The state at the end of an increment: anchors follow the slip, and are lost on facets where nothing touches."""
    at, shear, weight = nearest(model, state.x), friction.shear(springs, seen(model, state.x)), model.facets.weight
    touches = at.penetration > 0
    kept = touches | (held & touches.any(axis=1, keepdims=True))
    anchor = np.where(springs.limit > 0, at.arc - shear.size / springs.stiffness,
                      _anchors(nearest(model, before.state.x), at, before.anchor))
    slipping = float(np.sum(weight * (touches & (shear.slope == 0))) / np.sum(weight * touches))
    lost = float(np.sum(weight * np.abs(shear.size) * shear.slipped))
    return Loaded(state, np.where(kept, anchor, np.nan), springs, change, slipping, before.dissipated + lost)


def _reached(model: IndentationProblem, coefficient: float, before: Loaded, near: Loaded, depth: float) -> Loaded:
    """The foam at a corrected depth, one increment from `before`: Newton's method in the force's logarithm from `near`,
    kept between two forces that miss the depth on either side."""
    last, short, over = np.inf, None, None
    for _ in range(_DEPTH_STEPS):
        missing, state = depth - near.state.depth, near.state
        if abs(missing) <= _DEPTH_TOLERANCE * depth:
            return near
        short, over = (state, over) if missing > 0 else (short, state)
        if short and over and over.force - short.force <= _SAME_FORCE * over.force and abs(missing) <= _JUMP * depth:
            return replace(near, unsettled=max(near.unsettled, abs(missing) / depth))
        force, last = load_continuation(depth, state, short, over, last), abs(missing)
        near = _in_halves(model, coefficient, before, force, settle=True)
    raise NotConverged(f"the depth of {depth:.4f} thicknesses was not reached; the nearest was "
                       f"{near.state.depth:.4f}.", estimate=near.state.x, residuals=near.state.residuals)
