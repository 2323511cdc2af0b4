"""Axisymmetric touches: a rounded punch, flat, spherical or conical, pressed into foam about its own axis.

Every touch is solved from rest on a coarse mesh and carried over to finer ones, up to the mesh that is asked for. The
difference of the two finest is the error estimate, but at least a floor that was measured on Table 1, 8 to 20 mm and
0.05 to 3 N, against meshes of a third of the default element size: there the default size leaves at most 0.05 % in
depth and 0.31 % in the dipole response of a skin driven by the normal strain. The largest pressure is the largest
average over a facet of the contact force over the current area. With 10 mm and 2 N it is 69.5, 70.6 and 71.0 kPa at the
default element size, a half and a quarter of it, where no point has more than 71.1; below 0.3 N, where it peaks within
two facets, it was up to 17 % low. With friction it is loaded in increments
(`eitsim.mechanics.axisymmetric.friction_increments`), and what halving them changes adds to the errors.

A hemisphere may touch with any part of its face. Pressed alone, its coarsest mesh is fine all along it; the others are
fine about the place where the contact ends on that one, which halves the time.

Two meshes of one contact stiffness do not show what the stiffness leaves in the contact area and in the strain: what a
quarter of it changes on the coarser mesh adds to their errors. Where the contact ends is known to the distance between
points of contact, and the area to the ring between the outermost that touches and the next; by chance two meshes agree
better than that. On 104 random profiles see benchmarks/touch_errors.py. The radius where the contact ends is
interpolated between points, and moves by chance within the facet in which it ends (`surface.END`).
"""

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial

import numpy as np

from eitsim.mechanics.axisymmetric import friction_increments, indentation, surface
from eitsim.mechanics.axisymmetric.continuation import (
    TAKEN_OVER,
    carried_over,
    cold_start,
    load_continuation,
    not_taken_over,
    squeezed_by_tip,
    warm_start,
)
from eitsim.mechanics.axisymmetric.friction_increments import FrictionHistory
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem, equilibrium
from eitsim.mechanics.contact import friction
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.bonded_laws import Bonded
from eitsim.mechanics.solid.grid import default_element_m, feature_m
from eitsim.numerics.work_budget import bounded
from eitsim.scene.results import Section, Touch
from eitsim.scene.scene import FRICTIONS, STRAINS, Body, Punch, profile_of
from eitsim.sheet.sheet_conductance import driving_strains
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

# Floors of the relative errors of depth and signal at the default element size h_0, and their powers of h/h_0.
_DEPTH_FLOOR, _SIGNAL_FLOOR, _DEPTH_POWER, _SIGNAL_POWER = 5e-4, 2e-3, 1.0, 1.5
# Floors of the relative errors of the largest pressure and of the contact area.
_PEAK_FLOOR, _AREA_FLOOR = 0.01, 1e-3
# Share of the contact's stiffness whose effect estimates the error that it leaves.
_SOFTER = 1 / 4
# Least element size, in default sizes: about 5 GB.
_FINEST = 1 / 8
# Least size of the coarsest level's elements, in default sizes: there a start from rest is cheapest.
_COARSEST = 3.0
# Feature lengths over which elements keep their size outside where a conducting punch's contact ends on the coarsest
# mesh, whose elements are half of one long.
_PAST_END = 1.0
# A prescribed depth: relative error at which it is reached, that from which the tangent leads there, whose slope is off
# by less than a thousandth, and steps towards it.
_DEPTH_TOLERANCE, _ALONG_TANGENT, _DEPTH_STEPS = 1e-9, 1e-6, 60
# Relative residual to which a punch is held before its depth is corrected.
_ROUGHLY = 1e-3
# Factorisations on the finest mesh whose work a touch without friction may take, and unknowns up to which it may take
# as many as on a mesh of so many: the dearest random scenes take 10, laws at the edge of ellipticity that are solved up
# to 120, and on 9,100 unknowns 1,300 are taken on the way to 187 N on a 14 mm punch, 0.99 thicknesses deep.
FACTORISATIONS, UNKNOWNS = 300, 50_000


def solve_touch(law: Law, body: Body, punch: Punch, *, element_m: float | None = None,
                penalty: float | None = None, order: int = 2, factorisations: float | None = None) -> Touch:
    """Equilibrium of the foam under the punch's force, or at its depth where the force is None; of a layer on the soft
    base that a body has where the law is `Bonded`, and its section is then the layer's.

    element_m: element size at the punch's edge, m, by default grid.default_element_m; penalty: contact stiffness, mu_0
    over grid.feature_m, by default the profile's; order: of the elements, one of grid.ELEMENTS; factorisations: most on
    the finest mesh without friction, `allowed` by default. ValueError for a profile or friction that is not known,
    NotConverged where no equilibrium is found.
    """
    started = cpu_s()
    if punch.friction == "none":
        levels, states = alone(law, body, punch, element_m=element_m, penalty=penalty, order=order,
                               factorisations=factorisations)
        return touch_of(law, body, levels, states, started)
    if punch.force_N is not None:
        return solve_path(law, body, punch, [punch.force_N], element_m=element_m, penalty=penalty, order=order)[0]
    depth = _depth(body, punch)
    levels, shear_limit = _rubbing(law, body, punch, element_m, penalty, order)
    if shear_limit == 0:
        return touch_of(law, body, levels, at_depth(levels, depth), started)
    return rubbed(law, body, levels, rubbed_course(levels, shear_limit, None, depth), started)


def alone(law: Law, body: Body, punch: Punch, *, element_m: float | None = None, penalty: float | None = None,
          order: int = 2, factorisations: float | None = None
          ) -> tuple[list[IndentationProblem], list[Equilibrium]]:
    """Problems from coarse to fine and their equilibria of one touch without friction, as of solve_touch. A hemisphere
    is all edge: where its contact ends on the coarsest mesh is where elements of the others are least."""
    force = None if punch.force_N is None else _positive([punch.force_N])[0] / force_unit(law, body)
    depth = 0.0 if force is not None else _depth(body, punch)
    profile = profile_of(punch)
    if profile.edge_radius < profile.radius or punch.conductor:
        levels = mesh_hierarchy(law, body, punch, element_m, penalty, order)
        with _allowed(levels[-1], factorisations):
            return levels, at_depth(levels, depth) if force is None else under_force(levels, force)
    level, sizes = _refinements(law, body, punch, element_m, penalty, order)
    coarsest = level(sizes[0])
    with _allowed(coarsest):
        first = _coarsest_at_depth(coarsest, depth, len(sizes) > 2) if force is None else cold_start(coarsest, force)
    end_m, edge_m = surface.contact_of(coarsest, first.x).radius * body.thickness_m, profile.radius
    inside = end_m < edge_m - feature_m(body, replace(punch, fillet_m=edge_m))
    levels = [coarsest, *(level(size, end_m=end_m if inside else None) for size in sizes[1:])]
    with _allowed(levels[-1], factorisations):
        return levels, _finer(levels, first, None if force is not None else depth)


def solve_path(law: Law, body: Body, punch: Punch, forces_N: Sequence[float], *, element_m: float | None = None,
               penalty: float | None = None, order: int = 2) -> list[Touch]:
    """Equilibria under several forces in this order, each started from the one before; otherwise as solve_touch. With
    friction the order is the way the punch was loaded, and the equilibria depend on it."""
    return list(solved_along(law, body, punch, _positive(forces_N), element_m=element_m, penalty=penalty, order=order))


def _positive(forces_N: Sequence[float]) -> Sequence[float]:
    if not all(0 < force < np.inf for force in forces_N):
        raise ValueError(f"forces_N must be positive (N, pressing into the layer), got {list(forces_N)}.")
    return forces_N


def _depth(body: Body, punch: Punch) -> float:
    """The depth of a punch without a force, thicknesses."""
    if punch.depth_m is None or not 0 < punch.depth_m < body.thickness_m:
        raise ValueError(f"the punch's depth_m must lie between 0 and the thickness of {body.thickness_m} m where "
                         f"force_N is None, got {punch.depth_m}.")
    return punch.depth_m / body.thickness_m


def solved_along(law: Law, body: Body, punch: Punch, forces_N: Iterable[float], *, element_m: float | None = None,
                 penalty: float | None = None, order: int = 2) -> Iterator[Touch]:
    """As `solve_path`, each touch as it is found, so that who takes them may stop."""
    started, unit = cpu_s(), force_unit(law, body)
    levels, shear_limit = _rubbing(law, body, punch, element_m, penalty, order)
    states = None
    if shear_limit > 0:
        scaled = [force / unit for force in forces_N]
        for course in friction_increments.under_forces(levels[-2], levels[-1], shear_limit, scaled):
            yield rubbed(law, body, levels, course, started)
            started = cpu_s()
        return
    for force in forces_N:
        states = under_force(levels, force / unit, states[0] if states else None)
        yield touch_of(law, body, levels, states, started)
        started = cpu_s()


def force_unit(law: Law, body: Body) -> float:
    """Force, N, of one unit of a problem: mu_0 H^2."""
    return law.mu_0_Pa * body.thickness_m**2


def mesh_hierarchy(law: Law, body: Body, punch: Punch, element_m: float | None,
                   penalty: float | None, order: int = 2, even: float | None = None, curvature_per_m: float = 0.0
                   ) -> list[IndentationProblem]:
    """Frictionless problems from coarse to fine, halving; the coarsest has _COARSEST default element sizes or more;
    even and curvature_per_m as of `indentation.indentation_problem`; elements are even by default to where a conducting
    punch's contact ends, since its readings depend on that place, and else to the punch's edge."""
    level, sizes = _refinements(law, body, punch, element_m, penalty, order, curvature_per_m)
    if even is None:
        even = _even_to_the_end(law, body, punch, level(sizes[0])) if punch.conductor else 0.0
    return [level(size, even=even) for size in sizes]


def _refinements(law: Law, body: Body, punch: Punch, element_m: float | None, penalty: float | None, order: int,
                 curvature_per_m: float = 0.0) -> tuple[Callable[..., IndentationProblem], list[float]]:
    """As of mesh_hierarchy, the problem of an element size, m, and the sizes from coarse to fine."""
    if punch.friction != "none":
        raise ValueError(f"friction in [punch]: '{punch.friction}' is not built here; built is none.")
    profile = profile_of(punch)
    punch = replace(punch, fillet_m=profile.edge_radius)
    default = default_element_m(body, punch)
    sizes = [default if element_m is None else element_m]
    if not _FINEST * default <= sizes[0] < body.thickness_m / 2:
        raise ValueError(f"element_m must lie between {_FINEST * default:.3g} m (finer ones exceed the memory) and "
                         f"half the thickness, got {element_m}; the default is {default:.3g} m.")
    while len(sizes) < 2 or sizes[0] < _COARSEST * default:
        sizes.insert(0, 2 * sizes[0])
    penalty = profile.default_penalty if penalty is None else penalty
    return partial(indentation.indentation_problem, law, body, punch, penalty=penalty, order=order,
                   curvature_per_m=curvature_per_m), sizes


def _even_to_the_end(law: Law, body: Body, punch: Punch, model: IndentationProblem) -> float:
    """Feature lengths from the punch's edge to _PAST_END outside where its contact ends on a mesh; 0 where that is
    inside the edge, or no equilibrium is found."""
    if punch.force_N is None and punch.depth_m is None:
        return 0.0
    try:
        (state,) = (at_depth([model], (punch.depth_m or 0.0) / body.thickness_m) if punch.force_N is None
                    else under_force([model], punch.force_N / force_unit(law, body)))
    except NotConverged:
        return 0.0
    past = surface.contact_of(model, state.x).radius - model.punch.profile.radius
    return max(past * body.thickness_m / feature_m(body, punch) + _PAST_END, 0.0)


def _rubbing(law: Law, body: Body, punch: Punch, element_m: float | None, penalty: float | None,
             order: int) -> tuple[list[IndentationProblem], float]:
    """Problems as without friction, and the largest shear over pressure."""
    if punch.friction not in FRICTIONS:
        raise ValueError(f"friction in [punch]: '{punch.friction}' is unknown; known: {', '.join(FRICTIONS)}.")
    smooth = replace(punch, friction="none")
    return mesh_hierarchy(law, body, smooth, element_m, penalty, order), friction.coefficient(punch)


def rubbed_course(levels: list[IndentationProblem], shear_limit: float, force: float | None, depth: float,
                  increments: int = friction_increments.INCREMENTS) -> FrictionHistory:
    """The course with friction, in so many increments, to a force or, where that is None, to a corrected depth,
    thicknesses."""
    if force is not None:
        return next(friction_increments.under_forces(levels[-2], levels[-1], shear_limit, [force], increments))
    guess = at_depth(levels[:1], depth)[0].force
    return friction_increments.at_depth(levels[-2], levels[-1], shear_limit, depth, guess, increments)


def rubbed(law: Law, body: Body, levels: list[IndentationProblem], course: FrictionHistory,
           started: float) -> Touch:
    """A touch with friction; what half as many increments change, and the last pass did, adds to its errors."""
    touch = touch_of(law, body, levels[-2:], [course.coarse.state, course.fine.state], started)
    touch = with_change(touch, levels[-2], course.coarse.state, course.rough.state)
    return replace(touch, depth_error=touch.depth_error + course.fine.unsettled, slip_fraction=course.fine.slipping,
                   cpu_s=cpu_s() - started)


def allowed(unknowns: int) -> float:
    """Factorisations of so many unknowns whose work a touch without friction may take."""
    return FACTORISATIONS * max(1.0, UNKNOWNS / unknowns)


def _allowed(model: IndentationProblem, factorisations: float | None = None) -> AbstractContextManager[None]:
    """The work that a touch may take whose finest mesh is this one."""
    return bounded(factorisations or allowed(model.grid.unknowns), model.grid.unknowns)


def under_force(levels: list[IndentationProblem], force: float, before: Equilibrium | None = None) -> list[Equilibrium]:
    """Equilibria on all levels under a force, from the coarsest level's one before or from rest."""
    with _allowed(levels[-1]):
        return _finer(levels, warm_start(levels[0], before, force) if before else cold_start(levels[0], force), None)


def at_depth(levels: list[IndentationProblem], depth: float) -> list[Equilibrium]:
    """Equilibria on all levels at a corrected depth: with the punch held there or, where that fails, by Newton's method
    in the logarithm of the force."""
    with _allowed(levels[-1]):
        return _finer(levels, _coarsest_at_depth(levels[0], depth, len(levels) > 2), depth)


def _coarsest_at_depth(model: IndentationProblem, depth: float, near: bool) -> Equilibrium:
    """As `at_depth`, on the coarsest level; near as of `pressed`."""
    guess = np.pi * model.punch.profile.radius**2 * depth
    return pressed(model, depth, guess, near=near) or reached(model, depth, cold_start(model, guess))


def _finer(levels: list[IndentationProblem], first: Equilibrium, depth: float | None) -> list[Equilibrium]:
    """Equilibria on all levels from that of the coarsest, at a corrected depth or, where that is None, its force."""
    states = [first]
    for coarse, fine in itertools.pairwise(levels):
        moved = None if depth is None else pressed(fine, depth, states[-1].force, indentation.transferred(
            states[-1].x, coarse.grid, fine.grid))
        state = moved or carried_over(coarse, states[-1], fine)
        states.append(state if moved or depth is None else reached(fine, depth, state))
    return states


def pressed(model: IndentationProblem, depth: float, force: float, x: Array | None = None, *,
            near: bool = False) -> Equilibrium | None:
    """The equilibrium at a corrected depth, from rest or a state x, under about that force: the punch is held where it
    is, then where the correction asks for, and what is left is reached as below. None where that fails. near: a state
    to _ROUGHLY, which a finer mesh starts from."""
    try:
        spent: tuple[float, ...] = ()
        if x is None:
            first = indentation.held_from_rest(model, depth, force)
            x, spent = first.x, first.residuals
        rough, step = indentation.held(model, indentation.relieved(model, None, x), force, _ROUGHLY)
        ahead = rough.x + step + (depth - rough.depth) / rough.by_force[-1] * rough.by_force
        spent += rough.residuals
        if near:
            return replace(rough, x=ahead, residuals=spent)
        state, _ = indentation.held(model, ahead, rough.force)
        return reached(model, depth, replace(state, residuals=spent + state.residuals))
    except NotConverged:
        return None


def reached(model: IndentationProblem, depth: float, state: Equilibrium) -> Equilibrium:
    """The equilibrium whose corrected depth is the given one, from a near one: Newton's method in the logarithm of the
    force, kept between two forces that miss the depth on either side.

    The derivative by the force, and with it the correction, jumps where a point of contact comes or goes, by up to 7e-4
    of the depth in 108 touches of Table 1, 4e-5 in half of them; the equilibrium itself does not jump. Where this leaps
    over the depth, the equilibrium there is the one returned.
    """
    spent, last, short, over = state.residuals, np.inf, None, None
    for _ in range(_DEPTH_STEPS):
        missing, tolerance = depth - state.depth, _DEPTH_TOLERANCE * depth
        short, over = (state, over) if missing > 0 else (short, state)
        if short and over and abs(over.x[-1] - short.x[-1]) <= tolerance:
            return replace(state, depth=depth, residuals=spent)
        if abs(missing) <= _ALONG_TANGENT * depth:
            more = missing / float(state.by_force[-1])
            return replace(state, x=state.x + more * state.by_force, force=state.force + more, depth=depth,
                           residuals=spent)
        state, last = _ahead(model, state, load_continuation(depth, state, short, over, last)), abs(missing)
        spent += state.residuals
    nearest = " and ".join(f"{near.depth:.4f}" for near in (short, over) if near)
    raise NotConverged(f"the depth of {depth:.4f} thicknesses was not reached; the nearest found: {nearest}.",
                       estimate=state.x, residuals=spent, load_fraction=state.depth / depth)


def _ahead(model: IndentationProblem, state: Equilibrium, force: float) -> Equilibrium:
    """The equilibrium under another force, along the tangent or, where that fails, from the state itself."""
    try:
        return equilibrium(model, force, state.x + state.by_force * (force - state.force))
    except NotConverged:
        return equilibrium(model, force, state.x)


class Unresolved(NotConverged):
    """An equilibrium whose surface a mesh is too coarse to show; a finer one may do."""


def touch_of(law: Law, body: Body, levels: list[IndentationProblem], states: list[Equilibrium],
             started: float) -> Touch:
    """The finest level's equilibrium as a touch, its errors from the two finest; `law` gives the units."""
    model, state, unit = levels[-1], states[-1], body.thickness_m
    radius, field = surface.samples(model, state.x)
    if not np.all(field.normal > 0):
        if len(state.residuals) > TAKEN_OVER and squeezed_by_tip(levels[-2], states[-2]):
            raise not_taken_over(states[-2])
        raise Unresolved("the mesh does not resolve the foam at the punch's edge or tip: its surface is found turned "
                         "inside out there. Try a larger fillet, or a smaller force or depth.", estimate=state.x,
                         residuals=state.residuals)
    finest, coarser = ((m, s.x) for m, s in zip(levels[:-3:-1], states[:-3:-1], strict=True))
    contact, rough = surface.contact_of(*finest), surface.contact_of(*coarser)
    pressure = np.interp(radius, contact.middle, contact.pressure, right=0.0)
    force_N = state.force * force_unit(law, body)
    depth_error, signal_errors = _errors(levels, states)
    residuals = tuple(r for s in states for r in s.residuals)
    elliptic = indentation.elliptic(model, state.x)
    lost = indentation.non_elliptic_place(model, elliptic)
    soft_area, soft_strain = penalty_errors(levels[-2], states[-2])
    area = min(contact.area, np.pi * model.punch.profile.radius**2)
    return Touch(
        radius_m=radius * unit, u_r_m=(field.position[:, 0] - radius) * unit, u_z_m=field.position[:, 1] * unit,
        stretch_meridian=field.meridian, stretch_hoop=field.hoop, stretch_normal=field.normal,
        pressure_Pa=pressure * law.mu_0_Pa, contact_radius_m=contact.radius * unit, force_N=force_N,
        depth_m=state.depth * unit, sigma_max_Pa=float(contact.pressure.max()) * law.mu_0_Pa,
        sigma_ave_Pa=force_N / (area * unit**2), contact_area_m2=area * unit**2,
        wall_contact_m2=contact.wall * unit**2, depth_error=depth_error, signal_errors=signal_errors,
        sigma_max_error=max(abs(rough.pressure.max() / contact.pressure.max() - 1), _PEAK_FLOOR),
        contact_area_error=soft_area + max(abs(rough.area / contact.area - 1), contact.area / area - 1,
                                           contact.ring / area, _AREA_FLOOR),
        contact_end_error=contact.end_error,
        strain_errors=strain_changes(finest, coarser) + soft_strain,
        fraction_non_elliptic=float(1 - np.mean(elliptic)),
        non_elliptic_m=None if lost is None else lost * unit, iterations=len(residuals), residuals=residuals,
        cpu_s=cpu_s() - started,
        section=_section(law, model, state.x[:-1], unit))


def _section(law: Law, model: IndentationProblem, u: Array, unit: float) -> Section:
    """Displacements (unknowns,) on the elements of the foam, or of the layer alone where it lies on a soft base."""
    grid, volume = model.grid, axisymmetric_assembly.volume_modes(model.law, model.grid, u)
    nodes, elements, moved = grid.nodes * unit, grid.counter_clockwise, axisymmetric_assembly.nodal(grid, u) * unit
    if not isinstance(law, Bonded) or not isinstance(model.law, Bonded) or model.law.below is None:
        return Section(nodes, elements, moved, law, volume)
    layer = ~model.law.below
    kept, elements = np.unique(elements[layer], return_inverse=True)
    return Section(nodes[kept], elements.reshape(int(layer.sum()), -1), moved[kept], law.layer,
                   None if volume is None else volume[layer])


def _errors(levels: list[IndentationProblem], states: list[Equilibrium]) -> tuple[float, Array]:
    """Relative errors of depth, at equal force, and (3,) of the dipole responses: differences of the two finest
    levels."""
    coarse, fine = states[-2:]
    shift = fine.depth - coarse.depth - fine.by_force[-1] * (fine.force - coarse.force)
    before, after = (surface.dipole_responses(m, s.x) for m, s in zip(levels[-2:], states[-2:], strict=True))
    scale = levels[-1].relative_size
    return (max(abs(shift) / fine.depth, _DEPTH_FLOOR * scale**_DEPTH_POWER),
            np.maximum(np.abs(before / after - 1), _SIGNAL_FLOOR * scale**_SIGNAL_POWER))


def strain_changes(fine: tuple[IndentationProblem, Array], rough: tuple[IndentationProblem, Array]) -> Array:
    """(3,) relative differences, L2 over the surface, of the strains that may drive the skin in two states: of the two
    finest levels they are, at first order, what the contact's end leaves, the finer one's own errors."""
    (radius, exact), (rough_radius, other) = (
        (r, driving_strains(field.meridian, field.hoop, field.normal))
        for r, field in (surface.samples(*state) for state in (fine, rough)))
    missed = exact - np.array([np.interp(radius, rough_radius, each) for each in other])
    return np.sqrt(np.trapezoid(missed**2 * radius, radius) / np.trapezoid(exact**2 * radius, radius))


def penalty_errors(model: IndentationProblem, state: Equilibrium) -> tuple[float, Array]:
    """Relative changes of contact area and (3,) surface strains by a contact _SOFTER times as stiff, which two meshes
    of one stiffness do not show. A quarter changes at least what the stiffness itself leaves, if that falls with the
    root of the stiffness or faster. The whole where no such state is found."""
    try:
        soft = indentation.softened(model, state, _SOFTER)
    except NotConverged:
        return 1.0, np.ones(len(STRAINS))
    area = surface.contact_of(model, state.x).area
    return (abs(surface.contact_of(model, soft).area / area - 1),
            strain_changes((model, state.x), (model, soft)))


def with_change(touch: Touch, model: IndentationProblem, fine: Equilibrium, rough: Equilibrium) -> Touch:
    """The touch with the change from `fine` to `rough`, equilibria of one mesh in half as many steps, in its errors."""
    shift = abs(rough.depth - fine.depth - fine.by_force[-1] * (rough.force - fine.force)) / fine.depth
    before, after = (surface.dipole_responses(model, state.x) for state in (rough, fine))
    return replace(touch, depth_error=touch.depth_error + shift,
                   signal_errors=touch.signal_errors + np.abs(before / after - 1))
