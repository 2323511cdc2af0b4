"""Axisymmetric touches: a frictionless punch with a rounded edge pressed into a foam disc about its own axis.

Every touch is solved from rest on a mesh of twice the element size and carried over to the mesh that is asked for;
the difference of the two tells the error.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eitsim import surface
from eitsim.mesh import default_element_m
from eitsim.pressing import Equilibrium, Pressing, at_rest, equilibrium, fraction_non_elliptic, pressing, transferred
from eitsim.results import Touch
from eitsim.scene import Body, Punch
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]

# Nominal contact pressure over penetration, in mu_0 over the thickness: 10 MPa/mm for 9.53 kPa and 10 mm.
PENALTY = 1.05e4
# How often the force is halved for a start where Newton's method fails from rest.
_HALVINGS = 5
# Relative error and number of steps at which a prescribed depth is reached.
_DEPTH_TOLERANCE, _DEPTH_STEPS = 1e-9, 30


def solve_touch(law: Hyperfoam, body: Body, punch: Punch, *, element_m: float | None = None, strain: str = "normal",
                penalty: float = PENALTY) -> Touch:
    """Equilibrium of the foam under the punch's force, or at its depth where the force is None.

    element_m: element size at the punch's edge, m, by default mesh.default_element_m; strain: the skin's driving
    strain for which signal_error is told; penalty: contact stiffness, mu_0 over the thickness. ValueError for what is
    not built (profile, friction), NotConverged where no equilibrium is found.
    """
    started = time.process_time()
    levels = _levels(law, body, punch, element_m, penalty)
    if punch.force_N is not None:
        states = _under_force(levels, punch.force_N / _force_unit(law, body), None)
    elif punch.depth_m is not None:
        states = _at_depth(levels, punch.depth_m / body.thickness_m)
    else:
        raise ValueError("the punch has neither force_N nor depth_m; give one of them.")
    return _touch(law, body, levels, states, strain, started)


def solve_path(law: Hyperfoam, body: Body, punch: Punch, forces_N: Sequence[float], *, element_m: float | None = None,
               strain: str = "normal", penalty: float = PENALTY) -> list[Touch]:
    """Equilibria under several forces in this order, each started from the one before; otherwise as solve_touch."""
    levels = _levels(law, body, punch, element_m, penalty)
    touches, states = [], None
    for force in forces_N:
        started = time.process_time()
        states = _under_force(levels, force / _force_unit(law, body), states[0] if states else None)
        touches.append(_touch(law, body, levels, states, strain, started))
    return touches


def _force_unit(law: Hyperfoam, body: Body) -> float:
    return law.mu_0_Pa * body.thickness_m**2


def _levels(law: Hyperfoam, body: Body, punch: Punch, element_m: float | None, penalty: float) -> list[Pressing]:
    """Pressings from coarse to fine, halving; the coarsest with at least twice the default element size."""
    if punch.profile != "flat":
        raise ValueError(f"profile in [punch]: '{punch.profile}' is not built; built is 'flat'.")
    if punch.friction != "none":
        raise ValueError(f"friction in [punch]: '{punch.friction}' is not built; built is 'none'.")
    default = default_element_m(body, punch)
    sizes = [element_m or default]
    while len(sizes) < 2 or sizes[0] < 1.5 * default:
        sizes.insert(0, 2 * sizes[0])
    return [pressing(law, body, punch, size, penalty) for size in sizes]


def _under_force(levels: list[Pressing], force: float, before: Equilibrium | None) -> list[Equilibrium]:
    """Equilibria on all levels under a force."""
    first = equilibrium(levels[0], force, before.x) if before else _from_rest(levels[0], force, _HALVINGS)
    states = [first]
    for coarse, fine in zip(levels, levels[1:], strict=False):
        states.append(equilibrium(fine, force, transferred(states[-1].x, coarse.grid, fine.grid)))
    return states


def _from_rest(model: Pressing, force: float, halvings: int) -> Equilibrium:
    try:
        return equilibrium(model, force, at_rest(model, force))
    except NotConverged:
        if halvings == 0:
            raise
    return equilibrium(model, force, _from_rest(model, force / 2, halvings - 1).x)


def _at_depth(levels: list[Pressing], depth: float) -> list[Equilibrium]:
    """Equilibria on all levels whose corrected depth is the given one: Newton's method in the logarithm of the force.
    """
    guess = 2 * np.pi * levels[0].tool.radius**2 * depth
    states = [_reached(levels[0], depth, _from_rest(levels[0], guess, _HALVINGS))]
    for coarse, fine in zip(levels, levels[1:], strict=False):
        old = states[-1]
        start = equilibrium(fine, old.force, transferred(old.x, coarse.grid, fine.grid))
        states.append(_reached(fine, depth, start))
    return states


def _reached(model: Pressing, depth: float, state: Equilibrium) -> Equilibrium:
    for _ in range(_DEPTH_STEPS):
        missing = depth - state.depth
        if abs(missing) <= _DEPTH_TOLERANCE * depth:
            return state
        growth = np.exp(np.clip(missing / (state.by_force[-1] * state.force), -1, 1))
        force = float(state.force * growth)
        state = equilibrium(model, force, state.x + state.by_force * (force - state.force))
    raise NotConverged(f"the depth of {depth:.4f} thicknesses was not reached; the nearest was {state.depth:.4f}.",
                       estimate=state.x, residuals=state.residuals)


def _touch(law: Hyperfoam, body: Body, levels: list[Pressing], states: list[Equilibrium], strain: str,
           started: float) -> Touch:
    model, state, unit = levels[-1], states[-1], body.thickness_m
    radius, field = surface.samples(model, state.x)
    contact = surface.contact_of(model, state.x)
    pressure = np.interp(radius, contact.middle, contact.pressure, right=0.0)
    force_N = state.force * _force_unit(law, body)
    signals = [surface.dipole_response(m, s.x, strain) for m, s in zip(levels[-2:], states[-2:], strict=True)]
    residuals = tuple(r for s in states for r in s.residuals)
    return Touch(
        radius_m=radius * unit, u_r_m=(field.position[:, 0] - radius) * unit, u_z_m=(field.position[:, 1] - 1) * unit,
        stretch_meridian=field.meridian, stretch_hoop=field.hoop, stretch_normal=field.normal,
        pressure_Pa=pressure * law.mu_0_Pa, contact_radius_m=contact.radius * unit, force_N=force_N,
        depth_m=state.depth * unit, sigma_max_Pa=float(contact.pressure.max()) * law.mu_0_Pa,
        sigma_ave_Pa=force_N / (contact.area * unit**2), contact_area_m2=contact.area * unit**2,
        wall_contact_m2=contact.wall * unit**2, depth_error=abs(states[-2].depth / state.depth - 1),
        signal_error=abs(signals[0] / signals[1] - 1), fraction_non_elliptic=fraction_non_elliptic(model, state.x),
        iterations=len(residuals), residuals=residuals, cpu_s=time.process_time() - started)
