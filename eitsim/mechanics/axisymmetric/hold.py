"""A touch that lasts: creep under a force that is kept, relaxation at a depth that is kept, after loading.

A depth that is kept from loading in no time needs no solving: the deformation stays, every stress is the instantaneous
one times G(t)/G_0, so equilibrium and the contact with a rigid punch stay, and force and pressures fall by G(t)/G_0.
All else is stepped in time by `eitsim.mechanics.axisymmetric.viscoelastic`. The error of the steps is the change from
half as many on the coarsest mesh, about three times what is left.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric import solve_axisymmetric
from eitsim.mechanics.axisymmetric.continuation import cold_start, warm_start
from eitsim.mechanics.axisymmetric.friction_hold import held_with_friction
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem, equilibrium
from eitsim.mechanics.axisymmetric.solve_axisymmetric import (
    at_depth,
    mesh_hierarchy,
    rubbed,
    rubbed_course,
    solve_touch,
    under_force,
)
from eitsim.mechanics.axisymmetric.viscoelastic import Memory, loaded_at_once, remembered, stepped, steps_s, unloaded
from eitsim.mechanics.contact import friction
from eitsim.numerics.work_budget import bounded
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Hold, Punch
from matcal.laws.law import Law, scaled
from matcal.laws.prony import Prony, relaxation
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

# Steps per decade of time; a loading that takes time has twice as many.
PER_DECADE = 4
# A kept depth: relative difference up to which two depths are one, relative error, steps towards it, largest step in
# the force's logarithm, and least share of the whole compliance that the foam is taken to have where it is flat.
_SAME, _KEPT, _KEPT_STEPS, _LARGEST_STEP, _LEAST_SLOPE = 1e-6, 1e-9, 40, 0.5, 0.05


@dataclass(frozen=True)
class HoldHistory:
    """What is asked of a touch over time; forces over mu_0 H^2, depths over H."""

    series: Prony  # Prony series of the foam
    force: float | None  # force at the end of loading; None where the depth is given
    depth: float | None  # depth at the end of loading; None where the force is given
    hold: Hold  # control, loading time and times of the hold


@dataclass(frozen=True)
class Step:
    """One step in time and what holds at its end."""

    length_s: float  # its length, s
    force: float | None  # force over mu_0 H^2; None where the depth is given
    depth: float | None  # depth over H; None where the force is given


def solve_hold(law: Law, series: Prony, body: Body, punch: Punch, hold: Hold, *, element_m: float | None = None,
               per_decade: int = PER_DECADE) -> list[tuple[float, Touch]]:
    """(time, s, touch) at the end of loading, where the time is 0, and at each of the hold's times, increasing. law:
    instantaneous moduli; per_decade: steps in time; the rest as in axisymmetric.solve_touch. ValueError for other
    moduli, no times, or friction that is not `stepped_with_friction`, NotConverged where no equilibrium is found."""
    if law.moduli != "instantaneous" or not hold.time_s:
        raise ValueError(f"a hold needs instantaneous moduli and times, got {law.moduli} ones and {hold.time_s} s.")
    times = np.append(0.0, np.unique(hold.time_s))
    if hold.keeps_deformation:
        return kept(series, hold, solve_touch(law, body, punch, element_m=element_m))
    started = cpu_s()
    levels, rubs = mesh_hierarchy(law, body, replace(punch, friction="none"), element_m, None), punch.friction != "none"
    if rubs and not stepped_with_friction(punch, hold):
        raise ValueError("friction in [punch]: a depth that is kept, or reached over time, is not built with friction; "
                         "give a force, and control = \"force\" in [hold].")
    force = None if punch.force_N is None else punch.force_N / solve_axisymmetric.force_unit(law, body)
    depth = None if punch.depth_m is None or force is not None else punch.depth_m / body.thickness_m
    if rubs:
        return _rubbed(law, series, body, levels, friction.coefficient(punch), force, depth, hold, per_decade)
    course = HoldHistory(series, force, depth, hold)
    loaded = _loaded_at_once(levels, course) if hold.loading_s == 0 else None
    starts = loaded or [None] * len(levels)
    courses = [states_over(level, course, per_decade, start) for level, start in zip(levels, starts, strict=True)]
    halved = states_over(levels[0], course, max(per_decade // 2, 1), starts[0])
    out = []
    for t, rough, *states in zip(times, halved, *courses, strict=True):
        touch = solve_axisymmetric.touch_of(law, body, levels, states, started)
        touch = solve_axisymmetric.with_change(touch, levels[0], states[0], rough)
        # the law alone does not give the section's stresses
        out.append((float(t), replace(touch, section=None)))
        started = cpu_s()
    return out


def stepped_with_friction(punch: Punch, hold: Hold) -> bool:
    """Whether a punch that sticks or rubs is stepped in time: under a force, to which it is loaded or which is kept."""
    return hold.control == "force" and (punch.force_N is not None or hold.loading_s == 0)


def _rubbed(law: Law, series: Prony, body: Body, levels: list[IndentationProblem], coefficient: float,
            force: float | None, depth: float | None, hold: Hold, per_decade: int) -> list[tuple[float, Touch]]:
    """As solve_hold, of a touch with friction under a force."""
    started, times = cpu_s(), tuple(np.unique(hold.time_s).tolist())
    loaded = (hold.loading_s, force) if hold.loading_s and force else rubbed_course(
        levels, coefficient, force, depth or 0.0)
    courses = held_with_friction(levels, coefficient, series, times, per_decade, loaded)
    touches = [replace(rubbed(law, body, levels, course, started), section=None) for course in courses]
    spent = (cpu_s() - started) / len(touches)
    return [(t, replace(touch, cpu_s=spent)) for t, touch in zip((0.0, *times), touches, strict=True)]


def kept(series: Prony, hold: Hold, touch: Touch) -> list[tuple[float, Touch]]:
    """(time, s, touch) as solve_hold, of a touch whose deformation is kept from loading at once."""
    times = np.append(0.0, np.unique(hold.time_s))
    return [(float(t), relaxed(touch, float(g))) for t, g in zip(times, relaxation(series, times), strict=True)]


def relaxed(touch: Touch, share: float) -> Touch:
    """The touch with its deformation kept and every stress times share."""
    section, volume = touch.section, touch.volume
    if section is not None:
        section = replace(section, law=scaled(section.law, share))
    if volume is not None:
        volume = replace(volume, law=scaled(volume.law, share), pressure_Pa=volume.pressure_Pa * share)
    return replace(touch, section=section, volume=volume, pressure_Pa=touch.pressure_Pa * share,
                   force_N=touch.force_N * share, sigma_max_Pa=touch.sigma_max_Pa * share,
                   sigma_ave_Pa=touch.sigma_ave_Pa * share)


def _loaded_at_once(levels: list[IndentationProblem], course: HoldHistory) -> list[Equilibrium]:
    if course.force is not None:
        return under_force(levels, course.force)
    assert course.depth is not None
    return at_depth(levels, course.depth)


def states_over(model: IndentationProblem, course: HoldHistory, per_decade: int,
                loaded: Equilibrium | None) -> list[Equilibrium]:
    """Equilibria at the end of loading and at each time of the hold, in as many steps per decade, on one mesh. loaded:
    the equilibrium after loading in no time; None where loading takes time."""
    if loaded is None:
        memory, loaded = _ramped(model, course, 2 * per_decade)
    else:
        memory = loaded_at_once(model, course.series, loaded.x)
    force, depth = (loaded.force, None) if course.hold.control == "force" else (None, loaded.depth)
    ends = steps_s(course.series, np.array(course.hold.time_s), per_decade)
    steps = [Step(float(length), force, depth) for length in np.diff(ends, prepend=0.0)]
    held = stepped_through(model, course.series, memory, loaded, steps)
    return [loaded, *(state for t, (_, state) in zip(ends, held, strict=True) if t in course.hold.time_s)]


def _ramped(model: IndentationProblem, course: HoldHistory, steps: int) -> tuple[Memory, Equilibrium]:
    def share(end: float | None, k: int) -> float | None:
        return None if end is None else end * k / steps

    ramp = [Step(course.hold.loading_s / steps, share(course.force, k), share(course.depth, k))
            for k in range(1, steps + 1)]
    return list(stepped_through(model, course.series, unloaded(model, course.series), None, ramp))[-1]


def stepped_through(model: IndentationProblem, series: Prony, memory: Memory, state: Equilibrium | None,
                    steps: list[Step]) -> Iterator[tuple[Memory, Equilibrium]]:
    """Memory and equilibrium after each step; `state` is the one before, None at rest."""
    spent, phase = 0.0, "loading" if state is None else "the hold"
    for step in steps:
        spent += step.length_s
        try:
            with bounded(solve_axisymmetric.allowed(model.grid.unknowns), model.grid.unknowns):
                state = _met(stepped(model, series, memory, step.length_s), step, state)
        except NotConverged as error:
            raise type(error)(f"{error} This was {spent:.3g} s after the start of {phase}.",
                              estimate=error.estimate, residuals=error.residuals) from None
        memory = remembered(model, series, memory, step.length_s, state.x)
        yield memory, state


def _met(model: IndentationProblem, step: Step, before: Equilibrium | None) -> Equilibrium:
    """The equilibrium at the end of a step, from the one before or from rest."""
    if step.force is not None:
        return warm_start(model, before, step.force) if before else cold_start(model, step.force)
    assert step.depth is not None
    if before is None:
        return at_depth([model], step.depth)[0]
    if abs(step.depth - before.depth) > _SAME * step.depth:
        return solve_axisymmetric.reached(model, step.depth, equilibrium(model, before.force, before.x))
    return _kept(model, step.depth, before)


def _kept(model: IndentationProblem, target: float, before: Equilibrium) -> Equilibrium:
    """The equilibrium at a depth that is the one before's: Newton's method in the logarithm of the force. The contact's
    penetration, which the depth leaves out, is taken in proportion to the force: the deformation hardly changes, and so
    the depth does not jump where points of contact come and go."""
    penetration = (float(before.x[-1]) - before.depth) / before.force
    force, state = before.force, before
    for _ in range(_KEPT_STEPS):
        state = equilibrium(model, force, state.x)
        missing = target - (float(state.x[-1]) - penetration * force)
        if abs(missing) <= _KEPT * target:
            return replace(state, depth=target - missing)
        slope = max(state.by_force[-1] - penetration, _LEAST_SLOPE * state.by_force[-1])
        force = float(force * np.exp(np.clip(missing / (slope * force), -_LARGEST_STEP, _LARGEST_STEP)))
    raise NotConverged(f"the depth of {target:.4f} thicknesses was not kept in {_KEPT_STEPS} steps.",
                       estimate=state.x, residuals=state.residuals)
