"""What a touch's surface becomes when its force or depth, the punch's diameter or the foam's law change a little.

In equilibrium the energy's gradient g(x, p) is zero, so dx/dp = -H^-1 dg/dp with the Hessian H at hand: one
factorisation serves all parameters p. dx/dF is exact; the others take dg/dp as a central difference of the gradient at
a kept x. The mesh is carried along with the punch's edge, so that nothing jumps. What the rim changes is solved anew on
either side (`eitsim.simulation.derivatives.tangent`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric import surface
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem, equilibrium, system
from eitsim.mechanics.axisymmetric.solve_axisymmetric import alone, force_unit, touch_of
from eitsim.mechanics.contact.punch_contact import POINTS, facets_at
from eitsim.mechanics.rim.solve_near_rim import COARSE, FINE, Resolution, rim_change
from eitsim.mechanics.solid.grid import tensor_grid
from eitsim.scene.results import Array, RimField, Touch
from eitsim.scene.scene import Body, Punch, profile_of
from matcal.laws.law import Law, differentiable, over, vector, with_vector

STEP = 1e-5  # Step of the differences, over the parameter.
# That of what the rim changes, over the parameter, and of the distance to the rim, in thicknesses.
_RIM_STEP, _RIM_PLACE = 0.01, 0.02


@dataclass(frozen=True, eq=False)
class Settled:
    """A touch and what it was solved from; all that its tangent needs."""

    law: Law
    body: Body
    punch: Punch
    model: IndentationProblem
    state: Equilibrium
    touch: Touch
    # what the rim changes, by the distance from the disc's centre in m; None where the rim is far
    by_offset: RimLine | None = None


@dataclass(frozen=True, eq=False)
class Varied:
    """A touch on either side of one parameter."""

    name: str  # as in a data set, for instance "d_mm", its unit at the end
    step: float  # half the difference between both sides, in that unit
    # whether it is the foam's, and so changes all touches
    shared: bool
    less: tuple[Punch, Touch]
    more: tuple[Punch, Touch]


@dataclass(frozen=True)
class _Parameter:
    name: str
    step: float  # in the unit that ends the name
    at: Callable[[float], tuple[Law, Punch]]  # law and punch with that many units more than given
    shared: bool = False  # whether it is the foam's


def settled(law: Law, body: Body, punch: Punch, *, element_m: float | None = None,
            near_rim: bool = False) -> Settled:
    """A touch without friction, as axisymmetric.solve_touch or near_rim.solve_near_rim finds it; NotConverged as there.
    """
    started = time.process_time()
    levels, states = alone(law, body, punch, element_m=element_m)
    touch = touch_of(law, body, levels, states, started)
    base = Settled(law, body, punch, levels[-1], states[-1], touch)
    return _beside_rim(base) if near_rim else base


def _beside_rim(base: Settled) -> Settled:
    field, place = rim_change(base.law, base.body, base.punch).field, np.array([base.punch.x_m, base.punch.y_m])
    outwards = place / np.linalg.norm(place)

    def at(by_m: float) -> tuple[Law, Punch]:
        x_m, y_m = place + by_m * outwards
        return base.law, replace(base.punch, x_m=float(x_m), y_m=float(y_m))

    gap = base.body.radius_m - field.offset_m - base.punch.diameter_m / 2
    step = min(_RIM_PLACE * base.body.thickness_m, gap / 2)
    line = rim_line(field, base.body, base.punch, at, step)
    return replace(base, touch=replace(base.touch, rim=field), by_offset=line)


def shifted(base: Settled, by_m: Array) -> tuple[Punch, Touch]:
    """The touch moved by a small vector (2,), m."""
    x_m, y_m = (np.array([base.punch.x_m, base.punch.y_m]) + by_m).tolist()
    punch = replace(base.punch, x_m=x_m, y_m=y_m)
    if base.by_offset is None:
        return punch, base.touch
    further = float(np.hypot(x_m, y_m)) - base.by_offset.field.offset_m
    return punch, replace(base.touch, rim=base.by_offset.at(further))


def varied(base: Settled) -> Iterator[Varied]:
    """The touch on either side of F_N, or of depth_mm where that is given, of d_mm, and of the law's mu_i_Pa, alpha_i.

    All others are kept: the force, or the corrected depth, too.
    """
    _, factorise = system(base.model, base.state.force, base.state.x)
    solve, (load, by_load) = factorise(), _load(base)
    yield _sides(base, load, [(base.model, sign * load.step * by_load) for sign in (-1, 1)])
    for parameter in _parameters(base):
        ends = [changed(base, *parameter.at(sign * parameter.step)) for sign in (-1, 1)]
        less, more = (system(model, force, base.state.x)[0] for model, force in ends)
        shift = -solve(more - less) / 2
        if base.punch.force_N is None:
            less, more = (equilibrium(model, force, base.state.x + sign * shift).depth
                          for sign, (model, force) in zip((-1, 1), ends, strict=True))
            shift = shift - by_load * (more - less) / 2 * base.body.thickness_m * 1e3
        yield _sides(base, parameter, [(model, sign * shift) for sign, (model, _) in zip((-1, 1), ends, strict=True)])


def _load(base: Settled) -> tuple[_Parameter, Array]:
    """Force or depth as a parameter, and the derivative of the state by it, in its unit."""
    state, unit = base.state, force_unit(base.law, base.body)
    if base.punch.force_N is not None:
        force_N = base.punch.force_N
        return _Parameter("F_N", STEP * force_N, lambda more: (
            base.law, replace(base.punch, force_N=force_N + more))), state.by_force / unit
    less, more = (equilibrium(base.model, force, state.x + state.by_force * (force - state.force)).depth
                  for force in (state.force * (1 - STEP), state.force * (1 + STEP)))
    depth_mm = state.depth * base.body.thickness_m * 1e3
    by_depth = state.by_force * 2 * STEP * state.force / (more - less)
    return (_Parameter("depth_mm", STEP * depth_mm, lambda more: (
        base.law, replace(base.punch, depth_m=(depth_mm + more) / 1e3))), by_depth / (base.body.thickness_m * 1e3))


def _parameters(base: Settled) -> Iterator[_Parameter]:
    law, punch = base.law, base.punch
    yield _Parameter("d_mm", STEP * punch.diameter_m * 1e3,
                     lambda more: (law, replace(punch, diameter_m=punch.diameter_m + more / 1e3)))
    at = vector(law)
    for name, one in differentiable(law):
        size = law.mu_0_Pa if name.endswith("_Pa") else abs(float(one @ at)) or 1.0
        yield _Parameter(name, STEP * size, lambda more, one=one: (with_vector(law, at + more * one), punch), True)


def _sides(base: Settled, parameter: _Parameter, ends: Sequence[tuple[IndentationProblem, Array]]) -> Varied:
    """The surface of both ends, each a problem and what is added to the state."""
    less, more = (sampled(base, model, base.state.x + shift) for model, shift in ends)
    if base.by_offset is not None:
        line = rim_line(base.by_offset.field, base.body, base.punch, parameter.at, parameter.step * _RIM_STEP / STEP,
                        COARSE if parameter.shared else FINE)
        less, more = (replace(touch, rim=line.at(sign * parameter.step)) for sign, touch in ((-1, less), (1, more)))
    return Varied(parameter.name, parameter.step, parameter.shared, (base.punch, less),
                  (base.punch, more))


def changed(base: Settled, law: Law, punch: Punch) -> tuple[IndentationProblem, float]:
    """The problem with another law and diameter, on the same mesh carried along, and its force without units."""
    unit, model = base.body.thickness_m, base.model
    before, after = model.punch.profile, profile_of(punch, unit)
    force = base.state.force * force_unit(base.law, base.body) / force_unit(law, base.body)
    law = over(law, law.mu_0_Pa)
    if after == before:
        return replace(model, law=law), force
    lines, rows = (line[::model.grid.order] for line in model.grid.lines)
    old, new = (np.array([0.0, p.radius - p.edge_radius, p.radius, lines[-1]]) for p in (before, after))
    grid = tensor_grid(np.interp(lines, old[old.argsort()], new[old.argsort()]), rows, order=model.grid.order)
    return replace(model, law=law, punch=replace(model.punch, profile=after), grid=grid,
                   facets=facets_at(grid, model.facets.nodes, *np.polynomial.legendre.leggauss(POINTS))), force


def sampled(base: Settled, model: IndentationProblem, x: Array) -> Touch:
    """The touch with the surface of another state; its contact and errors stay those of the base."""
    radius, field = surface.samples(model, x)
    return replace(base.touch, radius_m=radius * base.body.thickness_m, stretch_meridian=field.meridian,
                   stretch_hoop=field.hoop, stretch_normal=field.normal, section=None)


@dataclass(frozen=True, eq=False)
class RimLine:
    """A field of changes and its derivatives by one parameter."""

    field: RimField
    # (n,) and (n, k, ...) derivatives of radius, metric and normal factor, a unit of the parameter
    radius_m: Array
    metric: Array
    normal: Array
    offset_m: float  # derivative of the axis's distance from the disc's centre, m a unit

    def at(self, by: float) -> RimField:
        """The field with that many units more of the parameter."""
        field = self.field
        return replace(field, radius_m=field.radius_m + by * self.radius_m, metric=field.metric + by * self.metric,
                       normal=field.normal + by * self.normal, offset_m=field.offset_m + by * self.offset_m)


def rim_line(field: RimField, body: Body, punch: Punch, at: Callable[[float], tuple[Law, Punch]], step: float,
             fineness: Resolution = FINE) -> RimLine:
    """The line through a punch's field with the slope between `step` units less and more of a parameter, where the law
    and the punch are those of `at`; NotConverged as near_rim.rim_change."""
    ends = []
    for by in (-step, step):
        law, other = at(by)
        ends.append(_carried(rim_change(law, body, other, fineness).field, field.radius_m, punch, other))
    less, more = ends
    return RimLine(field, *((getattr(more, name) - getattr(less, name)) / (2 * step)
                            for name in ("radius_m", "metric", "normal", "offset_m")))


def _carried(field: RimField, radius_m: Array, punch: Punch, other: Punch) -> RimField:
    """The field of another punch at the radii of a punch's, moved with its edge."""
    edge, moved = punch.diameter_m / 2, other.diameter_m / 2
    inside, last = max(edge - punch.fillet_m, edge / 2), float(radius_m[-1])
    radii = np.interp(radius_m, [0.0, inside, edge, last], [0.0, moved - edge + inside, moved, moved - edge + last])
    samples = np.concatenate([field.metric, field.normal[..., None], field.displacement_m], axis=-1).reshape(
        len(field.radius_m), -1)
    values = np.stack([np.interp(radii, field.radius_m, column) for column in samples.T], axis=-1)
    values = values.reshape(len(radii), len(field.share), 7)
    return replace(field, radius_m=radii, metric=values[..., :3], normal=values[..., 3], displacement_m=values[..., 4:])
