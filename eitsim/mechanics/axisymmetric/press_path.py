"""Force against depth of one punch pressed from rest, with friction, and its derivatives by the law at equal depth.

In equilibrium the energy's gradient g(x, p) is the force f on the punch's depth alone, x = (displacements, depth). A
change of the law's parameters p at equal depth asks for another force, df/dp = (dg/dp)' dx/df / (d depth/df): with the
derivative dx/df that each equilibrium has, no further equation is solved. Springs of friction are kept as they are in
it. One coarse mesh serves: its forces are some 0.2 % from those of meshes of half the size.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from eitsim.mechanics.axisymmetric import friction_increments
from eitsim.mechanics.axisymmetric.continuation import cold_start
from eitsim.mechanics.axisymmetric.friction_increments import Loaded
from eitsim.mechanics.axisymmetric.indentation import IndentationProblem
from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit, mesh_hierarchy
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.meridian_response import response
from eitsim.numerics.work_budget import bounded
from eitsim.scene.scene import Body, Punch
from matcal.laws.law import Law, over, vector, with_vector
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Depths of a path over the deepest, and the least growth from one to the next.
_NODES, _GROWTH = np.geomspace(0.03, 1.0, 9), 1.05
# First force over that of the punch's cross-section under the first depth as strain.
_FIRST = 0.5
# Parts of a step that are tried, each from a part of the way along the tangent: of the first, at which forces too
# small for rounding may fail, and of others.
_SHARES = (((1.0, 0.0), (2.0, 0.0), (4.0, 0.0), (8.0, 0.0)), ((1.0, 1.0), (1.0, 0.0), (0.4, 1.0), (0.4, 0.0)))
_FACTORISATIONS, _ENOUGH = 400, 0.5  # of a path at most, and the part of it that has to be found
_STEP = 1e-5  # of the differences by parameters, over mu_0 of moduli, else 1


@dataclass(frozen=True, eq=False)
class PressPath:
    """Force on one punch against depth; logarithms are those of m and N."""

    log_depth: Array  # (n,) increasing
    log_force: Array  # (n,)
    power: Array  # (n,) d log_force/d log_depth
    by_law: Array  # (n, K) d log_force/dp at equal depth by `matcal.laws.law.vector`

    def at(self, log_depth: Array) -> Array:
        """ln force at logarithms of depths of any shape, cubic between the path's and a power outside them."""
        inside = np.clip(log_depth, self.log_depth[0], self.log_depth[-1])
        found = CubicHermiteSpline(self.log_depth, self.log_force, self.power)(inside)
        ends = np.where(log_depth < self.log_depth[0], self.power[0], self.power[-1])
        return found + ends * (log_depth - inside)


def press_path(law: Law, body: Body, punch: Punch, friction: float, deepest_m: float) -> PressPath:
    """The path of a punch to a depth, or as far as equilibria are found; friction: shear over pressure at which it
    slips.

    NotConverged where no equilibrium is found in the first half of it.
    """
    model = mesh_hierarchy(law, body, punch, None, None)[0]
    unit, deepest = body.thickness_m, deepest_m / body.thickness_m
    depth, force, power, by_law, now = [], [], [], [], friction_increments.at_rest(model)
    targets = _NODES * deepest
    with bounded(_FACTORISATIONS, model.grid.unknowns):
        while not depth or depth[-1] < deepest:
            ahead = targets[targets > (_GROWTH * depth[-1] if depth else 0.0)]
            try:
                now = _further(model, friction, now, float(ahead[0] if len(ahead) else _GROWTH * deepest))
            except NotConverged:
                if not depth or depth[-1] < _ENOUGH * deepest:
                    raise
                break
            state = now.state
            depth.append(state.depth)
            force.append(state.force)
            power.append(state.depth / state.force / state.by_force[-1])
            by_law.append(_by_law(law, model, now) / state.force)
    return PressPath(np.log(depth) + np.log(unit), np.log(force) + np.log(force_unit(law, body)), np.array(power),
                     np.array(by_law))


def _further(model: IndentationProblem, friction: float, now: Loaded, depth: float) -> Loaded:
    """The next equilibrium, near a depth and deeper than the last; elsewhere where none is found. NotConverged where
    there is none."""
    state = now.state
    if state.force == 0:
        ahead = _FIRST * np.pi * model.punch.profile.radius**2 * depth
        if not model.punch.profile.is_flat:
            ahead *= 4 * np.sqrt(depth / model.punch.profile.radius)
    else:
        power = state.depth / state.force / float(state.by_force[-1])
        ahead = state.force * ((depth / state.depth) ** power - 1)
    for share, along in _SHARES[int(state.force > 0)]:
        target = state.force + share * ahead
        try:
            x = state.x + along * state.by_force * share * ahead if state.force else cold_start(model, target).x
            found = friction_increments.increment(model, friction, now, target, x, settle=False)
        except NotConverged:
            continue
        if found.state.depth > state.depth:
            return found
    raise NotConverged(f"no equilibrium was found further than {state.depth:.3f} thicknesses.", estimate=state.x,
                       residuals=state.residuals)


def _by_law(law: Law, model: IndentationProblem, now: Loaded) -> Array:
    """(K,) derivatives of the force, over mu_0 H^2 of this law, by its parameters at equal depth."""
    state, grid = now.state, model.grid
    moved = axisymmetric_assembly.deformation(grid, state.by_force[:-1] / state.by_force[-1])
    grad_u = axisymmetric_assembly.deformation(grid, state.x[:-1])
    at, unit = vector(law), law.mu_0_Pa
    out = np.empty(len(at))
    for k, one in enumerate(np.eye(len(at))):
        step = _STEP * (unit if _is_modulus(law, k) else 1.0)
        less, more = (response(over(with_vector(law, at + sign * step * one), unit), grad_u,
                               projection=axisymmetric_assembly.projection_of(law, grid)).stress for sign in (-1, 1))
        out[k] = np.einsum("eq,eqi,eqi->", grid.weight, more - less, moved) / (2 * step)
    return out


def _is_modulus(law: Law, k: int) -> bool:
    sizes: Sequence[int] = [np.size(getattr(law, p.name)) for p in law.parameters]
    return law.parameters[int(np.searchsorted(np.cumsum(sizes), k, side="right"))].name.endswith("_Pa")
