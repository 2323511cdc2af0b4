"""A punch pressed into foam: the energy of foam, contact and dead force, and its equilibrium under a force.

Unknowns x are the free displacements and, last, the depth of the punch. Lengths are in foam thicknesses H, stresses
in mu_0, forces in mu_0 H^2, so that tolerances and the penalty need no units.
"""

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from eitsim.mechanics.contact import friction
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.friction import FrictionState, Nearest
from eitsim.mechanics.contact.punch_contact import ContactState, Facets, RigidPunch
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.bonded_laws import by_part, laid_on
from eitsim.mechanics.solid.cap_grid import on_cap
from eitsim.mechanics.solid.grid import Grid, default_element_m, feature_m, foam_grid, lagrange
from eitsim.mechanics.solid.volume_projection import projects
from eitsim.numerics.linear_solvers import Indefinite, Solve, bordered
from eitsim.numerics.newton import Minimum, System, minimise
from eitsim.scene.scene import Body, Punch, profile_of
from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.law import Law
from matcal.laws.volumetric import with_bulk
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Reference radius, thicknesses from the punch's edge, out to which the surface may touch it.
_REACH = 1.0
# Penetration, grid.feature_m, at which the contact is twice as stiff as its penalty: ten times the largest in common
# touches, so that it stays small where the foam is squeezed flat.
_FIRM = 0.05
# Stiffening penetrations that the punch may stand below the foam's bottom.
_THROUGH = 10.0
# Largest penetration, in fillet radii, that the penalty contact is trusted with.
_DEEPEST = 0.5
# Relative residual from which one Hessian serves to the end, and for the derivative by the force: by that, 1e-5 moved a
# corrected depth by up to 6e-8 of it.
_NEAR = 1e-7
# Iterations of a punch that is held at its depth, and relative residual of the first from rest.
_HOLDING, _FIRST = 40, 0.1
# Iterations and relative residual of a softened state, from which errors are estimated, and as _NEAR.
_SOFTENING, _SOFTENED, _NEARLY_SOFTENED = 30, 1e-6, 1e-3
# Steps without negative curvatures from a state that changes the volume.
_RELIEFS = 2
# Bulk moduli over mu_0 by way of which a layer is led that resists a change of volume at least twice as much. Relative
# residual of a start from which on it is led so, and of the states on the way.
_BULKS, _FAR, _NEARER = (50.0, 1_500.0, 45_000.0), 3.0, 1e-2
# Relative residual that rounding leaves of a law with kappa_0/mu_0 of one.
_ROUNDED = 1e-13
# Depth, thicknesses, from which bottoming out is the likely cause of a failure.
_FLAT = 0.9


@dataclass(frozen=True)
class IndentationProblem:
    """Foam under a punch, discretised."""

    # moduli over mu_0
    law: Law
    grid: Grid
    punch: RigidPunch
    facets: Facets
    relative_size: float  # element size over the default element size
    # (elements, points, 4) second Piola-Kirchhoff stress added to the law's, rr, rz, zz and hoop, over mu_0; None: none
    prestress: Array | None = None
    springs: FrictionState | None = None  # friction between foam and punch; None: none


@dataclass(frozen=True)
class Equilibrium:
    """A stable equilibrium of an indentation problem."""

    x: Array  # (unknowns + 1,) displacements and depth
    by_force: Array  # (unknowns + 1,) derivative of x by the force
    force: float  # force on the punch
    depth: float  # depth, corrected to first order for the penalty's penetration
    residuals: tuple[float, ...]  # relative residual after each iteration


def indentation_problem(law: Law, body: Body, punch: Punch, element_m: float, penalty: float,
                        order: int = 2, even: float = 0.0, curvature_per_m: float = 0.0, end_m: float | None = None
                        ) -> IndentationProblem:
    """Discretise a touch; penalty is nominal pressure over penetration, in mu_0 over grid.feature_m; order, even and
    end_m as of grid.foam_grid; curvature of the outer surface, 1/m, positive where convex."""
    unit = body.thickness_m
    grid, profile = foam_grid(body, punch, element_m, order, even, end_m), profile_of(punch, unit)
    if curvature_per_m:
        grid = on_cap(grid, curvature_per_m * unit)
    feature = feature_m(body, punch)
    rigid = RigidPunch(profile, penalty * unit / feature, _FIRM * feature / unit)
    facets = contact.top_facets(grid, profile.radius + _REACH)
    return IndentationProblem(laid_on(law, grid, -body.layer_m / unit), grid, rigid, facets,
                              element_m / default_element_m(body, punch))


def at_rest(model: IndentationProblem, force: float) -> Array:
    """Foam at rest under a punch so deep that its penalty balances the force, as far as that is trusted."""
    rest, first = np.zeros(model.grid.unknowns), first_touch(model)

    def excess(depth: float) -> float:
        return contact.forces(model.punch, model.facets, contact_state(model, np.append(rest, depth)))[1] - force

    deepest = first + _DEEPEST * model.punch.profile.edge_radius
    if excess(deepest) < 0:
        return np.append(rest, deepest)
    return np.append(rest, root_scalar(excess, bracket=(first, deepest), xtol=1e-15, rtol=1e-6).root)


def first_touch(model: IndentationProblem) -> float:
    """Depth of the punch's lowest point at which it begins to touch: negative on a hollow cap."""
    if model.grid.laid is None:
        return 0.0
    return contact.touching_depth(lambda depth: contact.contact_state(
        model.punch, model.facets, model.grid.nodes, depth).penetration)


def positions(model: IndentationProblem, x: Array) -> Array:
    """Current positions (nodes, 2)."""
    return model.grid.nodes + axisymmetric_assembly.nodal(model.grid, x[:-1])


def contact_state(model: IndentationProblem, x: Array, facets: Facets | None = None) -> ContactState:
    """Contact state at x, on the facets of the model or others."""
    return contact.contact_state(model.punch, facets or model.facets, positions(model, x), x[-1])


def nearest(model: IndentationProblem, x: Array) -> Nearest:
    """Where the foam's points of contact stand on the punch at x."""
    return friction.nearest(model.punch, model.facets, positions(model, x), float(x[-1]))


def seen(model: IndentationProblem, x: Array) -> Array:
    """Displacement (facets, points, 2) of the points of contact at x, as seen from the punch."""
    return friction.moved(model.facets, axisymmetric_assembly.nodal(model.grid, x[:-1]), float(x[-1]))


def equilibrium(model: IndentationProblem, force: float, start: Array, limit: int = 100,
                tolerance: float = 1e-10) -> Equilibrium:
    """Minimise foam energy + contact energy - force depth from start, in at most `limit` iterations to a gradient of
    `tolerance` times the force, or to rounding. NotConverged carries the last x, the residuals, and the state it got
    stuck in."""
    found = _minimum(model, force, start, force, limit, tolerance)
    return _settled(model, found, found.solve, force)


def held(model: IndentationProblem, start: Array, scale: float, tolerance: float = 1e-10) -> tuple[Equilibrium, Array]:
    """The equilibrium with the punch held at the depth where it starts, and the step (unknowns + 1,) by which Newton's
    method would go on; as `equilibrium`, with `scale` for the force. NotConverged too where it is not stable under its
    force."""
    found = _minimum(model, None, start, scale, _HOLDING, tolerance)
    at = contact_state(model, found.x)
    try:
        solve = bordered(lambda b: found.solve(np.append(b, 0.0))[:-1], *_stiffness(model, found.x, at, 1.0)[1:])
    except Indefinite:
        raise NotConverged("the punch would go on under its force.", estimate=found.x,
                           residuals=found.residuals) from None
    return (_settled(model, found, solve, _balance(model, found.x, at)[1]),
            -found.solve(system(model, None, found.x)[0]) if tolerance > _NEAR else np.zeros_like(found.x))


def held_from_rest(model: IndentationProblem, depth: float, scale: float) -> Minimum:
    """Roughly where foam at rest goes when the punch comes to a depth, its contact not growing stiffer: what does takes
    many steps to leave a punch that stands deep in it."""
    soft = replace(model, punch=replace(model.punch, stiffening_penetration=np.inf))
    return _minimum(soft, None, np.append(np.zeros(model.grid.unknowns), depth), scale, _HOLDING, _FIRST)


def _minimum(model: IndentationProblem, force: float | None, start: Array, scale: float, limit: int,
             tolerance: float) -> Minimum:
    tolerance = max(tolerance, _ROUNDED * model.law.kappa_0_Pa / model.law.mu_0_Pa)
    start, spent = _led(model, force, start, scale, limit)
    try:
        found = minimise(lambda x: energy(model, force, x), lambda x, share: system(model, force, x, share), start,
                         scale=scale, limit=limit, tolerance=tolerance, near=_NEAR)
        return replace(found, residuals=spent + found.residuals)
    except NotConverged as error:
        raise NotConverged(f"{error} {_state(model, error.estimate)}", estimate=error.estimate,
                           residuals=error.residuals) from None


def _led(model: IndentationProblem, force: float | None, start: Array, scale: float, limit: int
         ) -> tuple[Array, tuple[float, ...]]:
    """Where a start that is far from balance goes by way of laws that resist a change of volume less, and the residuals
    on the way; the start itself where they end nowhere, or none is softer. A step of Newton's method is as long as the
    change of volume that it leaves allows."""
    law, x = model.law, start
    spent: tuple[float, ...] = ()
    way = [replace(model, law=softer) for bulk in _BULKS if 2 * bulk * law.mu_0_Pa < law.kappa_0_Pa
           and (softer := with_bulk(law, bulk)) is not law]
    if not way or not np.isfinite(energy(model, force, start)) or (
            np.linalg.norm(system(model, force, start)[0]) <= _FAR * scale):
        return start, spent
    try:
        for now, after in pairwise((*way, model)):
            found = minimise(partial(energy, now, force), partial(system, now, force), x, scale=scale, limit=limit,
                             tolerance=_NEARER)
            x, spent = relieved(after, force, found.x), spent + found.residuals
    except NotConverged:
        return start, spent
    return x, spent


def _settled(model: IndentationProblem, found: Minimum, solve: Solve, force: float) -> Equilibrium:
    """The equilibrium at a minimum; solve is of displacements and depth."""
    at = contact_state(model, found.x)
    if problem := _implausible(model, at, found.x):
        raise NotConverged(f"{problem} {_state(model, found.x)}", estimate=found.x, residuals=found.residuals)
    by_force = solve(np.append(np.zeros(model.grid.unknowns), 1.0))
    push, reaction = contact.complementary_forces(model.punch, model.facets, at)
    if model.springs is not None:
        more = friction.forces(model.springs, model.facets, seen(model, found.x), elastic=True)
        push, reaction = push + more[0], reaction + more[1]
    penetration = float(_gathered(model, push) @ by_force[:-1] + reaction * by_force[-1])
    return Equilibrium(found.x, by_force, force, float(found.x[-1]) - penetration, found.residuals)


def relieved(model: IndentationProblem, force: float | None, x: Array) -> Array:
    """A state x taken from another mesh or law after steps without negative curvatures, where the law nearly keeps its
    volume and they lower the energy: the displacements of another change the volume of elements, and the pressure of
    that would make the Hessian indefinite."""
    value = energy(model, force, x) if projects(model.law) else np.inf
    for _ in range(_RELIEFS if np.isfinite(value) else 0):
        gradient, factorise = system(model, force, x, 0.0)
        try:
            moved = x - factorise()(gradient)
        except Indefinite:
            break
        before, value = value, energy(model, force, moved)
        if not value < before:
            break
        x = moved
    return x


def softened(model: IndentationProblem, state: Equilibrium, share: float) -> Array:
    """Where a state goes when the contact's stiffness falls to a share of its own, under the same force. What the model
    lacks of the state's balance, friction or what the foam remembers, is kept as a load. NotConverged as minimise."""
    softer = replace(model, punch=replace(model.punch, stiffness=share * model.punch.stiffness))
    kept = system(model, state.force, state.x)[0]

    def left(x: Array, scale: float) -> System:
        gradient, factorise = system(softer, state.force, x, scale)
        return gradient - kept, factorise

    return minimise(lambda x: energy(softer, state.force, x) - float(kept @ x), left, state.x, scale=state.force,
                    limit=_SOFTENING, tolerance=_SOFTENED, near=_NEARLY_SOFTENED).x


def _implausible(model: IndentationProblem, at: ContactState, x: Array) -> str:
    """Why a minimum is none of the physical problem; empty where it is fine."""
    deepest = float(at.penetration.max())
    if deepest / model.punch.profile.edge_radius > _DEEPEST:
        return (f"The foam under the punch's edge or tip is so stiff that it stands "
                f"{deepest / model.punch.profile.edge_radius:.1f} fillet radii "
                "inside the punch, more than the contact model allows.")
    return "The punch has gone through the foam between the points of contact." if x[-1] > 1 + deepest else ""


def _state(model: IndentationProblem, x: Array) -> str:
    lost, depth = fraction_non_elliptic(model, x), float(x[-1])
    cause = "the foam is squeezed flat" if depth > _FLAT else "strong ellipticity is lost" if lost else (
        "the law is elliptic everywhere")
    return (f"The punch stood {depth:.3f} thicknesses deep, where {cause} ({lost:.1%} of the points are not elliptic). "
            "Try a smaller force or depth, or a larger punch or fillet.")


def fraction_non_elliptic(model: IndentationProblem, x: Array) -> float:
    """Fraction of the quadrature points at which the law is not strongly elliptic."""
    return float(1 - np.mean(elliptic(model, x)))


def non_elliptic_place(model: IndentationProblem, holds: NDArray[np.bool_]) -> Array | None:
    """Least and largest reference radius and depth below the surface (2, 2) of points that are not `elliptic`; None
    without any."""
    lost = ~holds
    if not lost.any():
        return None
    shape_over_radius = model.grid.gradient[lost.nonzero()][..., 2]
    nodes = model.grid.nodes[model.grid.elements[lost.nonzero()[0]]]
    radius = 1 / shape_over_radius.sum(axis=-1)
    below = -radius * np.sum(shape_over_radius * nodes[..., 1], axis=-1)
    return np.array([[radius.min(), radius.max()], [below.min(), below.max()]])


def elliptic(model: IndentationProblem, x: Array) -> NDArray[np.bool_]:
    """(elements, points) whether the law is strongly elliptic."""
    grad_u = axisymmetric_assembly.deformation(model.grid, x[:-1])
    inside = axisymmetric_assembly.admissible(grad_u)
    stretches = axisymmetric_assembly.resisted(model.law, model.grid, np.where(inside[..., None], grad_u, 0.0))
    return inside & by_part(model.law, strongly_elliptic, stretches.reshape(-1, 3)).reshape(inside.shape)


def energy(model: IndentationProblem, force: float | None, x: Array) -> float:
    """Foam energy + contact energy - force depth at x, without the last where the punch is held and the force None;
    infinite where the foam is turned inside out, or the punch is below the foam's fixed bottom by more than the contact
    may yield."""
    if x[-1] > 1 + _THROUGH * model.punch.stiffening_penetration:
        return np.inf
    stored = axisymmetric_assembly.energy(model.law, model.grid, x[:-1], model.prestress)
    if model.springs is not None:
        stored += friction.energy(model.springs, model.facets, seen(model, x))
    return stored + contact.energy(model.punch, model.facets, contact_state(model, x)) - (force or 0.0) * float(x[-1])


def system(model: IndentationProblem, force: float | None, x: Array, negative_curvature_scale: float = 1.0) -> System:
    """Gradient of the energy at x and a function that factorises its Hessian, negative parts scaled; where the force is
    None the depth stays as it is."""
    gradient, tangent = axisymmetric_assembly.residual_and_tangent(
        model.law, model.grid, x[:-1], negative_curvature_scale, model.prestress)
    at = contact_state(model, x)
    push, reaction = _balance(model, x, at)

    def factorise() -> Solve:
        blocks, border, corner = _stiffness(model, x, at, negative_curvature_scale)
        place = model.grid.place[model.facets.nodes].reshape(len(blocks), -1)
        row, column = np.broadcast_arrays(place[:, :, None], place[:, None, :])
        lower, stiffness = (column >= 0) & (row >= column), tangent()
        np.add.at(stiffness.band, (column[lower], (row - column)[lower]), blocks.reshape(row.shape)[lower])
        solve = axisymmetric_assembly.factorised(model.grid, stiffness)
        if force is None:
            return lambda b: np.append(solve(b[:-1]), 0.0)
        return bordered(solve, border, corner)

    return np.append(gradient + push, 0.0 if force is None else reaction - force), factorise


def _balance(model: IndentationProblem, x: Array, at: ContactState) -> tuple[Array, float]:
    """Derivatives of the energies of contact and friction by the displacements (unknowns,), and by the depth."""
    push, reaction = contact.forces(model.punch, model.facets, at)
    if model.springs is not None:
        more = friction.forces(model.springs, model.facets, seen(model, x))
        push, reaction = push + more[0], reaction + more[1]
    return _gathered(model, push), reaction


def _stiffness(model: IndentationProblem, x: Array, at: ContactState,
               negative_curvature_scale: float) -> tuple[Array, Array, float]:
    """Second derivatives of the energies of contact and friction: facets' blocks, border (unknowns,) and corner."""
    blocks, border, corner = contact.stiffness(model.punch, model.facets, at, negative_curvature_scale)
    if model.springs is not None:
        more = friction.tangent(model.springs, model.facets, seen(model, x), negative_curvature_scale)
        blocks, border, corner = blocks + more[0], border + more[1], corner + more[2]
    return blocks, _gathered(model, border), corner


def _gathered(model: IndentationProblem, on_facets: Array) -> Array:
    unknown = model.grid.unknown[model.facets.nodes].reshape(len(model.facets.nodes), -1)
    free = unknown >= 0
    out = np.zeros(model.grid.unknowns)
    np.add.at(out, unknown[free], on_facets.reshape(unknown.shape)[free])
    return out


def transferred(x: Array, old: Grid, new: Grid) -> Array:
    """The state x of one grid on another: the old grid's displacement at the new nodes."""
    along_r, along_z = (interpolation(a, b, old.order) for a, b in zip(old.lines, new.lines, strict=True))
    values = axisymmetric_assembly.nodal(old, x[:-1]).reshape(*map(len, old.lines), 2)
    moved = np.einsum("im,mnk,jn->ijk", along_r, values, along_z, optimize=True).reshape(-1, 2)
    free = new.unknown >= 0
    out = np.empty(new.unknowns)
    out[new.unknown[free]] = moved[free]
    return np.append(out, x[-1])


def interpolation(nodes: Array, points: Array, order: int) -> Array:
    """Interpolation (points, nodes) of that order between the nodes of a line of elements."""
    left = np.clip((np.searchsorted(nodes[::order], points, side="right") - 1) * order, 0, len(nodes) - 1 - order)
    first, last = nodes[left], nodes[left + order]
    shape, _ = lagrange(order, (2 * points - first - last) / (last - first))
    out = np.zeros((len(points), len(nodes)))
    out[np.arange(len(points))[:, None], left[:, None] + np.arange(order + 1)] = shape
    return out
