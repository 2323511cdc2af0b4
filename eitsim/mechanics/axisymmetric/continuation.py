"""Ways to the equilibrium under a force: at once from rest or from a neighbour, from a coarser mesh, or in steps of the
force or of the roundness of the punch's edge."""

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from eitsim.mechanics.axisymmetric import indentation
from eitsim.mechanics.axisymmetric.indentation import (
    Equilibrium,
    IndentationProblem,
    at_rest,
    energy,
    equilibrium,
    relieved,
)
from eitsim.numerics.work_budget import used_up
from touchcal.errors import NotConverged

# Where the force cannot be reached at once: part of it at which the steps start, and how often that is divided again.
_FIRST, _STARTS = 1 / 8, 4
# Fillet, thicknesses, over whose round edge the foam slides freely, and the largest ratio of two fillets between it and
# the punch's own.
_ROUND, _SHARPER = 0.05, 2.5
# Steps in the logarithm of the force: first, least, and growth after one that succeeds.
_STEP, _LEAST_STEP, _GROWTH = 0.7, 0.02, 1.5
# Towards a depth: the largest step in the force's logarithm, and the part of the last step's miss above which the next
# one halves the interval of forces.
_LARGEST_STEP, _SLOW = 0.5, 0.5
# Depth over thickness from which a touch counts as bottomed out.
BOTTOM = 0.95
# Depth over thickness from which a tip must be taken over from a coarser mesh to a finer one: what is found from rest
# took tens of seconds and is turned inside out. What is found after more than so many iterations may be, too: of five
# cones two that took 58 were not, three that took 83 to 111 were.
_SQUEEZED, TAKEN_OVER = 0.7, 40
# Iterations of a step.
_ITERATIONS = 60
# Shares of a coarser mesh's state that are tried on a finer one: where the foam is squeezed flat, the whole of it may
# turn the foam inside out between the points at which the coarse mesh held it.
_SHARES = (1.0, 0.99, 0.98, 0.96, 0.93, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)

Found = TypeVar("Found")


def cold_start(model: IndentationProblem, force: float) -> Equilibrium:
    """The equilibrium under a force, from rest; where that fails from that of a rounder edge, or in steps from part of
    the force. NotConverged as in_steps."""
    try:
        return equilibrium(model, force, at_rest(model, force))
    except NotConverged as error:
        failed = error
    try:
        return fillet_continuation(model, force)
    except NotConverged:
        pass
    for k in range(1, _STARTS + 1):
        part = force * _FIRST**k
        try:
            start = equilibrium(model, part, at_rest(model, part))
        except NotConverged:
            continue
        return load_steps(model, start, force)
    failed.load_fraction = 0.0
    raise failed


def fillet_continuation(model: IndentationProblem, force: float) -> Equilibrium:
    """The equilibrium under a force by way of rounder edges of the punch, over which the foam slides freely.
    NotConverged where the edge is as round already, or an equilibrium on the way is not found."""
    fillet, path = model.punch.profile.edge_radius, ()
    steps = math.ceil(math.log(_ROUND / fillet) / math.log(_SHARPER) - 1e-9)
    if steps < 1:
        raise NotConverged("the punch's edge is round already.")
    x = at_rest(model, force)
    for k in range(steps + 1):
        profile = model.punch.profile.with_edge(fillet * (_ROUND / fillet) ** (1 - k / steps))
        rounder = replace(model.punch, profile=profile)
        state = equilibrium(replace(model, punch=rounder), force, x)
        x, path = state.x, path + state.residuals
    return replace(state, residuals=path)


def warm_start(model: IndentationProblem, before: Equilibrium, force: float) -> Equilibrium:
    """The equilibrium under a force, from that under another; in steps where that fails. NotConverged as in_steps."""
    try:
        return equilibrium(model, force, before.x)
    except NotConverged:
        return load_steps(model, before, force)


def carried_over(coarse: IndentationProblem, state: Equilibrium, fine: IndentationProblem) -> Equilibrium:
    """The equilibrium of a coarse mesh on a finer one; from rest where it cannot start there. NotConverged, which is
    BottomedOut beyond BOTTOM, where a tip squeezes the foam flat on the coarse mesh and cannot start either."""
    x = indentation.transferred(state.x, coarse.grid, fine.grid)
    for share in _SHARES:
        if np.isfinite(energy(fine, state.force, share * x)):
            try:
                start = relieved(fine, state.force, share * x)
                return equilibrium(fine, state.force, start)
            except NotConverged:
                break
    if squeezed_by_tip(coarse, state):
        raise not_taken_over(state)
    return cold_start(fine, state.force)


def squeezed_by_tip(model: IndentationProblem, state: Equilibrium) -> bool:
    """Whether the foam is nearly flat under a tip."""
    return state.depth > _SQUEEZED and not model.punch.profile.is_flat


def not_taken_over(state: Equilibrium) -> NotConverged:
    """What is raised where a finer mesh does not take over a state that a tip squeezes flat."""
    kind = BottomedOut if state.depth > BOTTOM else NotConverged
    return kind(f"The punch's tip stands {state.depth:.3f} thicknesses deep on a coarser mesh, and a finer one does "
                "not resolve the foam that it squeezes flat. Try a smaller force or depth, or a blunter punch.",
                estimate=state.x, load_fraction=1.0)


def load_continuation(depth: float, state: Equilibrium, short: Equilibrium | None, over: Equilibrium | None,
                      last: float) -> float:
    """The force of a corrected depth by the slope at a state, kept between those that fell short and went over; the
    middle of their logarithms where the step before, which missed by `last`, gained little."""
    missing = depth - state.depth
    growth = missing / (state.by_force[-1] * state.force)
    force = float(state.force * np.exp(np.clip(growth, -_LARGEST_STEP, _LARGEST_STEP)))
    if short and over:
        low, high = sorted((short.force, over.force))
        if abs(missing) > _SLOW * last or not low < force < high:
            return float(np.sqrt(low * high))
    return force


class BottomedOut(NotConverged):
    """No equilibrium under the force was found, and less of it already squeezes the foam flat."""


def or_raised(found: Found | None, error: NotConverged) -> Found:
    """What default elements gave where finer ones find no equilibrium; the error where they gave nothing, or the finer
    ones show that the touch is bottomed out."""
    if found is None or isinstance(error, BottomedOut):
        raise error
    return found


def load_steps(model: IndentationProblem, start: Equilibrium, force: float) -> Equilibrium:
    """The equilibrium under a force from that under another, in steps of the force's logarithm that adapt. NotConverged
    carries the last equilibrium, the residuals of the step that failed and, as load_fraction, the part of the force
    that was reached; it is BottomedOut where that is deeper than BOTTOM already."""
    state, step, sign = start, _STEP, 1 if force > start.force else -1
    while state.force != force:
        left = abs(np.log(force / state.force))
        target = force if left <= step else float(state.force * np.exp(sign * step))
        try:
            state, step = _next(model, state, target), _GROWTH * step
        except NotConverged as error:
            step = min(step, left) / 3
            if step < _LEAST_STEP or used_up():
                raise _short_of(state, force, error) from None
    return state


def _short_of(state: Equilibrium, force: float, error: NotConverged) -> NotConverged:
    """What is raised where the steps end at a state before the force."""
    share = state.force / force
    last = f"The last equilibrium held {share:.1%} of the force, {state.depth:.3f} thicknesses deep."
    kind, text = (BottomedOut, last) if share < 1 and state.depth > BOTTOM else (NotConverged, f"{error} {last}")
    return kind(text, estimate=state.x, residuals=error.residuals, load_fraction=share)


def _next(model: IndentationProblem, state: Equilibrium, force: float) -> Equilibrium:
    """The equilibrium under a near force, along the tangent where that is admissible."""
    ahead = state.x + state.by_force * (force - state.force)
    start = ahead if np.isfinite(energy(model, force, ahead)) else state.x
    return equilibrium(model, force, start, limit=_ITERATIONS)
