"""Equilibrium of a clipped disc: energy, gradient and curvature of what the rim adds, and their minimum."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact import stick_springs
from eitsim.mechanics.harmonics.clipped_disc import ClippedDisc, SurfaceQuadrature, amplitudes, unknowns_of
from eitsim.mechanics.harmonics.fourier_fields import apply_isotropic_stiffness, apply_tangent, forces, gradients
from eitsim.mechanics.harmonics.preconditioner import preconditioner
from eitsim.mechanics.solid import spatial_response
from eitsim.numerics.linear_solvers import Solve, conjugate_gradients
from eitsim.numerics.newton import Minimum, System, minimise
from matcal.laws.ellipticity import strongly_elliptic
from touchcal.arrays import Array

# Norm of the gradient over the force at which a solution is accepted.
_TOLERANCE = 1e-9
# Relative residual of the linear solves: at least, at most, and where only the curvature's sign is asked for.
_LEAST, _MOST, _SIGN = 1e-3, 0.03, 0.3


@dataclass(frozen=True)
class Contact:
    """Points of the surface under a punch, all (facets points, ..., angles)."""

    penetration: Array  # penetration, 0 where there is none
    # (., 3, .) and (., 3, 3, .): its derivatives by the position in the local frame
    normal: Array
    curvature: Array
    wall: NDArray[np.bool_]  # whether the side wall is nearest


@dataclass(frozen=True)
class Tangents:
    """Second derivatives of the energy at points, with their weights."""

    foam: Array  # (points, 45, angles) of the foam, as in `eitsim.mechanics.solid.spatial_response`
    bearing: Array  # (facets points, 3, 3, angles) of the contact


def energy(disc: ClippedDisc, x: Array) -> float:
    """Foam energy + tie + contact energy + springs - force depth at x, the last not where the depth is held, less the
    work of a neighbour's own stress; infinite where the foam is turned inside out."""
    added = amplitudes(disc, x[:-1])
    grad_u = displacement_gradient(disc, added)
    if not spatial_response.upright(grad_u):
        return np.inf
    with np.errstate(over="ignore", invalid="ignore"):
        stored = float(np.sum(disc.weight * disc.law.energy(spatial_response.principal(grad_u).log)))
    if not np.isfinite(stored):
        return np.inf
    at = contact_state(disc, x)
    held = float(np.sum(added * apply_isotropic_stiffness(disc.foam, disc.tie, added))) / 2
    if disc.outside is not None:
        held -= float(np.sum(disc.outside.stress * gradients(disc.foam, added)))
    pressed = contact.penalty_energy_density(disc.punch, at.penetration)
    pressed = pressed + stick_springs.potential(disc.springs, seen(disc, x))
    pressed = float(np.sum(disc.facing.weight * pressed))
    return stored + held + pressed - (0.0 if disc.held else disc.force * (disc.depth + float(x[-1])))


def displacement_gradient(disc: ClippedDisc, added: Array) -> Array:
    """Displacement gradient (points, 9, angles) of the foam, with what is outside."""
    own = gradients(disc.foam, disc.base + added)
    return own if disc.outside is None else own + disc.outside.displacement_gradient


def contact_state(disc: ClippedDisc, x: Array) -> Contact:
    u = seen(disc, x)
    across, around = disc.facing.radius + u[:, 0], u[:, 1]
    radius = np.hypot(across, around)
    penetration, n_r, n_z, bend, wall = disc.punch.profile.signed_distance(radius, u[:, 2])
    cosine, sine = across / radius, around / radius
    down = np.stack([n_z * cosine, n_z * sine, -n_r], axis=1)
    hoop = np.stack([-sine, cosine, np.zeros_like(sine)], axis=1)
    curvature = (n_r / radius)[:, None, None] * hoop[:, :, None] * hoop[:, None]
    curvature = curvature - bend[:, None, None] * down[:, :, None] * down[:, None]
    return Contact(np.maximum(penetration, 0.0), np.stack([n_r * cosine, n_r * sine, n_z], axis=1), curvature, wall)


def seen(disc: ClippedDisc, x: Array) -> Array:
    """Displacement (facets points, 3, angles) at x in the local frame, as seen from the punch."""
    out = on_surface(disc.facing, disc.base + amplitudes(disc, x[:-1]))
    out = out if disc.outside is None else out + disc.outside.shift
    out[:, 2] += disc.depth + float(x[-1])
    return out


def on_surface(facing: SurfaceQuadrature, amplitude: Array) -> Array:
    """Displacement (facets points, 3, angles) in the local frame."""
    at = np.einsum("pa,fach->fpch", facing.shape, amplitude[facing.nodes]).reshape(len(facing.weight), 3, -1)
    out = np.empty((len(at), 3, facing.weight.shape[1]))
    out[:, ::2], out[:, 1:2] = at[:, ::2] @ facing.circles.cosine, at[:, 1:2] @ facing.circles.sine
    return out


def from_surface(facing: SurfaceQuadrature, force: Array, amplitude: Array) -> Array:
    """Forces on amplitudes, of the shape of the given ones, of forces (facets points, 3, angles)."""
    at = np.empty((len(force), 3, amplitude.shape[2]))
    at[:, ::2] = force[:, ::2] @ np.swapaxes(facing.circles.cosine, 1, 2)
    at[:, 1:2] = force[:, 1:2] @ np.swapaxes(facing.circles.sine, 1, 2)
    at = at.reshape(len(facing.nodes), -1, *at.shape[1:])
    out = np.zeros_like(amplitude)
    np.add.at(out, facing.nodes, np.einsum("pa,fpch->fach", facing.shape, at))
    return out


def linearised(disc: ClippedDisc, x: Array, negative_curvature_scale: float = 1.0) -> tuple[Array, Tangents]:
    """Gradient (unknowns + 1,) of the energy at x and the tangents there, their negative parts scaled."""
    added = amplitudes(disc, x[:-1])
    at = spatial_response.principal(displacement_gradient(disc, added))
    stress, tangent = spatial_response.stress_and_tangent(disc.law, at, disc.weight, negative_curvature_scale)
    stress = stress if disc.outside is None else stress - disc.outside.stress
    touch = contact_state(disc, x)
    push = disc.facing.weight * contact.pressure(disc.punch, touch.penetration)
    held = disc.facing.weight[:, None] * stick_springs.pull(disc.springs, seen(disc, x))
    pulled = held + push[:, None] * touch.normal
    on = forces(disc.foam, stress, added) + apply_isotropic_stiffness(disc.foam, disc.tie, added)
    on = on + from_surface(disc.facing, pulled, added)
    bearing = (disc.facing.weight * contact.pressure_slope(disc.punch, touch.penetration))[:, None, None]
    bearing = bearing * touch.normal[:, :, None] * touch.normal[:, None]
    bearing = bearing + negative_curvature_scale * push[:, None, None] * touch.curvature
    bearing = bearing + disc.facing.weight[:, None, None] * stick_springs.tangent(disc.springs, seen(disc, x))
    unbalanced = 0.0 if disc.held else np.sum(pulled[:, 2]) - disc.force
    return np.append(unknowns_of(disc, on), unbalanced), Tangents(tangent, bearing)


def product(disc: ClippedDisc, tangents: Tangents, y: Array) -> Array:
    """The Hessian times y (unknowns + 1,); a held depth stands for itself."""
    step = amplitudes(disc, y[:-1])
    moved = on_surface(disc.facing, step)
    moved[:, 2] += 0.0 if disc.held else y[-1]
    pushed = np.einsum("fikj,fkj->fij", tangents.bearing, moved)
    out = apply_tangent(disc.foam, tangents.foam, step) + apply_isotropic_stiffness(disc.foam, disc.tie, step)
    out = out + from_surface(disc.facing, pushed, step)
    return np.append(unknowns_of(disc, out), y[-1] if disc.held else pushed[:, 2].sum())


def system(disc: ClippedDisc, x: Array, negative_curvature_scale: float = 1.0) -> System:
    """Gradient of the energy at x and a function that solves with its Hessian, negative parts scaled. The solve is by
    conjugate gradients, as exact as Newton's method needs."""
    gradient, tangents = linearised(disc, x, negative_curvature_scale)
    size = float(np.linalg.norm(gradient)) / disc.force
    tolerance = _SIGN if size <= _TOLERANCE else min(max(size, _LEAST), _MOST)

    def factorise() -> Solve:
        times = partial(product, disc, tangents)
        condition = preconditioner(disc, tangents.foam.sum(axis=2), tangents.bearing.sum(axis=3))
        step = conjugate_gradients(times, condition, gradient, tolerance)
        return lambda b: step if b is gradient else conjugate_gradients(times, condition, b, _LEAST)

    return gradient, factorise


def solve(disc: ClippedDisc, start: Array | None = None) -> Minimum:
    """What the rim adds, (unknowns + 1,) amplitudes and depth, from nothing or a start; NotConverged as `minimise`."""
    return minimise(lambda x: energy(disc, x), lambda x, scale: system(disc, x, scale),
                    np.zeros(disc.unknowns + 1) if start is None else start, scale=disc.force, tolerance=_TOLERANCE)


def reaction(disc: ClippedDisc, x: Array) -> float:
    """Force of the foam on the punch."""
    at = contact_state(disc, x)
    push = contact.pressure(disc.punch, at.penetration)[:, None] * at.normal
    pulled = stick_springs.pull(disc.springs, seen(disc, x)) + push
    return float(np.sum(disc.facing.weight * pulled[:, 2]))


def fraction_non_elliptic(disc: ClippedDisc, x: Array) -> float:
    """Fraction of the quadrature points at which the law is not strongly elliptic."""
    grad_u = displacement_gradient(disc, amplitudes(disc, x[:-1]))
    return float(1 - np.mean(strongly_elliptic(disc.law, spatial_response.principal(grad_u).log)[disc.weight > 0]))
