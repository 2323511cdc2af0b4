"""A punch pressed into foam: the energy of foam, contact and dead force, and its equilibrium under a force.

Unknowns x are the free displacements and, last, the depth of the punch. Lengths are in foam thicknesses H, stresses
in mu_0, forces in mu_0 H^2, so that tolerances and the penalty need no units.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from eitsim import punch as contact
from eitsim import solid
from eitsim.linear import Solve, bordered, factorise_band
from eitsim.mesh import Grid, foam_grid
from eitsim.newton import System, minimise
from eitsim.punch import Facets, Tool, Touching
from eitsim.scene import Body, Punch
from matcal.ellipticity import strongly_elliptic
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]

# Reference radius, thicknesses beyond the punch's edge, out to which the surface may touch it.
_REACH = 1.0
# Largest penetration, in fillet radii, that the penalty contact is trusted with.
_DEEPEST = 0.5


@dataclass(frozen=True)
class Pressing:
    """Foam under a punch, discretised."""

    # moduli over mu_0
    law: Hyperfoam
    grid: Grid
    tool: Tool
    facets: Facets


@dataclass(frozen=True)
class Equilibrium:
    """A stable equilibrium of a pressing."""

    # (unknowns + 1,) displacements and depth
    x: Array
    # (unknowns + 1,) derivative of x by the force
    by_force: Array
    # force on the punch
    force: float
    # depth, corrected to first order for the penalty's penetration
    depth: float
    # relative residual after each iteration
    residuals: tuple[float, ...]


def pressing(law: Hyperfoam, body: Body, punch: Punch, element_m: float, penalty: float) -> Pressing:
    """Discretise a touch; penalty is nominal pressure over penetration, in mu_0/H."""
    grid = foam_grid(body, punch, element_m)
    tool = Tool(punch.diameter_m / 2 / body.thickness_m, punch.fillet_m / body.thickness_m, penalty)
    return Pressing(replace(law, mu_Pa=law.mu_Pa / law.mu_0_Pa), grid, tool,
                    contact.top_facets(grid, tool.radius + _REACH))


def at_rest(model: Pressing, force: float) -> Array:
    """Foam at rest under a punch just deep enough for its penalty to balance the force."""
    area = np.pi * (model.tool.radius - model.tool.fillet / 2)**2
    return np.append(np.zeros(model.grid.unknowns), force / (model.tool.stiffness * area))


def positions(model: Pressing, x: Array) -> Array:
    """Current positions (nodes, 2)."""
    return model.grid.nodes + solid.nodal(model.grid, x[:-1])


def touching(model: Pressing, x: Array, facets: Facets | None = None) -> Touching:
    """Contact state at x, on the facets of the model or others."""
    return contact.touching(model.tool, facets or model.facets, positions(model, x), x[-1])


def equilibrium(model: Pressing, force: float, start: Array) -> Equilibrium:
    """Minimise foam energy + contact energy - force depth from start.

    NotConverged carries the last x, the residuals, and the physical state it got stuck in.
    """
    try:
        found = minimise(lambda x: energy(model, force, x), lambda x, share: system(model, force, x, share), start,
                         scale=force)
    except NotConverged as error:
        raise NotConverged(f"{error} {_state(model, error.estimate)}", estimate=error.estimate,
                           residuals=error.residuals) from None
    at = touching(model, found.x)
    if at.gap.max() > _DEEPEST * model.tool.fillet:
        raise NotConverged(f"the pressure pushes the foam {at.gap.max() / model.tool.fillet:.1f} fillet radii into the "
                           f"punch: the force is beyond this contact stiffness. {_state(model, found.x)}",
                           estimate=found.x, residuals=found.residuals)
    by_force = found.solve(np.append(np.zeros(model.grid.unknowns), 1.0))
    push, reaction = _contact_gradient(model, at)
    penetration = float(push @ by_force[:-1] + reaction * by_force[-1])
    return Equilibrium(found.x, by_force, force, float(found.x[-1]) - penetration, found.residuals)


def _state(model: Pressing, x: Array) -> str:
    lost = fraction_non_elliptic(model, x)
    cause = "strong ellipticity is lost there" if lost else "the law stays elliptic there"
    return (f"The punch stood {x[-1]:.3f} thicknesses deep; {cause} ({lost:.1%} of the points). Try a smaller force or "
            "another element size.")


def fraction_non_elliptic(model: Pressing, x: Array) -> float:
    """Fraction of the quadrature points at which the law is not strongly elliptic."""
    strain = solid.deformation(model.grid, x[:-1])
    inside = solid.admissible(strain)
    fine = strongly_elliptic(model.law, solid.log_stretches(np.where(inside[..., None], strain, 0.0)))
    return float(1 - np.mean(fine & inside))


def energy(model: Pressing, force: float, x: Array) -> float:
    """Foam energy + contact energy - force depth at x; infinite where the foam is turned inside out."""
    stored = solid.energy(model.law, model.grid, x[:-1])
    return stored + contact.energy(model.tool, model.facets, touching(model, x)) - force * float(x[-1])


def system(model: Pressing, force: float, x: Array, share: float = 1.0) -> System:
    """Gradient of the energy at x and a function that factorises its Hessian, negative parts scaled by share."""
    gradient, band = solid.residual_and_tangent(model.law, model.grid, x[:-1], share)
    at = touching(model, x)
    blocks, border, corner = contact.stiffness(model.tool, model.facets, at, share)
    push, reaction = _contact_gradient(model, at)
    unknown = _facet_unknowns(model)
    row, column = np.broadcast_arrays(unknown[:, :, None], unknown[:, None, :])
    lower = (column >= 0) & (row >= column)
    np.add.at(band, (column[lower], (row - column)[lower]), blocks.reshape(row.shape)[lower])
    edge = _gathered(model, border)

    def factorise() -> Solve:
        return bordered(factorise_band(band), edge, corner)

    return np.append(gradient + push, reaction - force), factorise


def _contact_gradient(model: Pressing, at: Touching) -> tuple[Array, float]:
    push, reaction = contact.forces(model.tool, model.facets, at)
    return _gathered(model, push), reaction


def _facet_unknowns(model: Pressing) -> NDArray[np.int64]:
    return model.grid.unknown[model.facets.nodes].reshape(-1, 6)


def _gathered(model: Pressing, on_facets: Array) -> Array:
    """Sum (facets, 3, 2) into the unknowns."""
    unknown = _facet_unknowns(model)
    free = unknown >= 0
    return np.bincount(unknown[free], on_facets.reshape(unknown.shape)[free], model.grid.unknowns)


def transferred(x: Array, old: Grid, new: Grid) -> Array:
    """The state x of one grid on another, bilinear between nodes."""
    values = solid.nodal(old, x[:-1]).reshape(*map(len, old.lines), 2)
    moved = RegularGridInterpolator(old.lines, values, bounds_error=False, fill_value=None)(new.nodes)
    free = new.unknown >= 0
    out = np.empty(new.unknowns)
    out[new.unknown[free]] = moved[free]
    return np.append(out, x[-1])
