"""Contact of the foam's top with a rigid punch: penetration, its pressure and energy, and their derivatives."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.contact.punch_shape import PunchShape
from eitsim.mechanics.solid.grid import Grid, lagrange
from eitsim.scene.profiles.profile import Profile
from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Gauss points a facet.
POINTS = 4
_TOUCHING = 1e-12  # Thicknesses to which the depth of first touch is found.
_ON_AXIS = 1e-12  # Radius of points on the axis, about which nothing curves there.


@dataclass(frozen=True)
class RigidPunch:
    """A punch and how hard it resists penetration."""

    profile: Profile
    stiffness: float  # penalty: nominal pressure over a small penetration
    # penetration at which the pressure is twice what the penalty alone gives; from there on it grows with the third
    # power
    stiffening_penetration: float = np.inf
    shape: PunchShape | None = None  # in space in place of the profile; None: that of the profile


class Faces(Protocol):
    """Parts of a surface with Gauss points."""

    @property
    def shape(self) -> Array:
        """(points, k) shape functions of their nodes."""
        ...

    @property
    def weight(self) -> Array:
        """(facets, points) quadrature weights, reference areas."""
        ...


@dataclass(frozen=True)
class Facets:
    """Top facets of order p with Gauss points."""

    nodes: Indices  # (facets, p + 1) nodes from the inner to the outer end
    shape: Array  # (points, p + 1) shape functions
    slope: Array  # (facets, points, p + 1) their derivatives by the reference radius
    radius: Array  # (facets, points) reference radius, on a curved cap by arc length
    weight: Array  # (facets, points) quadrature weight, 2 pi r included

    @property
    def within(self) -> Array:
        """(points,) place along each facet, from -1 to 1."""
        return self.shape @ np.linspace(-1, 1, self.shape.shape[1])


@dataclass(frozen=True)
class ContactState:
    """State of the Gauss points under a punch."""

    penetration: Array  # (facets, points) penetration, 0 where there is none
    normal: Array  # (facets, points, d) derivative of the penetration by the position: (r, z), or three in space
    curvature: Array  # (facets, points, d, d) second derivative
    wall: NDArray[np.bool_]  # (facets, points) whether the nearest point of the punch lies on its side wall


def top_facets(grid: Grid, reach: float = np.inf, points: int = POINTS) -> Facets:
    """Top facets that start inside the radius `reach`, with that many Gauss points each."""
    near = grid.flat_nodes[grid.top[:, 0], 0] < reach
    return facets_at(grid, grid.top[near], *np.polynomial.legendre.leggauss(points))


def facets_at(grid: Grid, nodes: Indices, t: Array, weight: Array) -> Facets:
    """Facets of these nodes (facets, p + 1) with points t in [-1, 1] and their weights (points,)."""
    shape, by_t = lagrange(grid.order, t)
    ends = grid.flat_nodes[nodes, 0]
    half = (ends[:, -1] - ends[:, 0])[:, None] / 2
    radius, around = ends @ shape.T, grid.nodes[nodes, 0] @ shape.T
    return Facets(nodes, shape, by_t[None] / half[..., None], radius, 2 * np.pi * around * half * weight)


def contact_state(punch: RigidPunch, facets: Facets, position: Array, depth: float) -> ContactState:
    """Contact state of nodes at `position` (nodes, 2), the lowest point of the punch `depth` below z = 0."""
    r, z = np.moveaxis(facets.shape @ position[facets.nodes], -1, 0)
    penetration, n_r, n_z, bend, wall = punch.profile.signed_distance(r, z + depth)
    tangent = np.stack([n_z, -n_r], axis=-1)
    curvature = -tangent[..., :, None] * tangent[..., None, :] * bend[..., None, None]
    return ContactState(np.maximum(penetration, 0.0), np.stack([n_r, n_z], axis=-1), curvature, wall)


def spatial_contact(punch: RigidPunch, seen: Array) -> ContactState:
    """Contact state of points (facets, points, 3) of the surface seen from the punch's lowest point, upright; normal
    and curvature have three components."""
    if punch.shape is not None:
        depth, (slope, bend) = punch.shape.penetration(seen), punch.shape.derivatives(seen)
        return ContactState(np.maximum(depth, 0.0), slope, bend, np.zeros(depth.shape, dtype=bool))
    x, y, height = np.moveaxis(seen, -1, 0)
    radius = np.maximum(np.hypot(x, y), _ON_AXIS)
    penetration, n_r, n_z, bend, wall = punch.profile.signed_distance(radius, height)
    cosine, sine = x / radius, y / radius
    down = np.stack([n_z * cosine, n_z * sine, -n_r], axis=-1)
    around = np.stack([-sine, cosine, np.zeros_like(sine)], axis=-1)
    curvature = (n_r / radius)[..., None, None] * around[..., :, None] * around[..., None, :]
    curvature = curvature - bend[..., None, None] * down[..., :, None] * down[..., None, :]
    return ContactState(np.maximum(penetration, 0.0), np.stack([n_r * cosine, n_r * sine, n_z], axis=-1), curvature,
                        wall)


def spatial_penetration(punch: RigidPunch, seen: Array) -> Array:
    """Depth (...) inside the punch of points (..., 3) as of `spatial_contact`, negative outside."""
    if punch.shape is not None:
        return punch.shape.penetration(seen)
    return punch.profile.signed_distance(np.hypot(seen[..., 0], seen[..., 1]), seen[..., 2]).penetration


def touching_depth(penetration: Callable[[float], Array]) -> float:
    """The depth, from -1 to 1, up to which no point is penetrated at rest: by bisection."""
    low, high = -1.0, 1.0
    while high - low > _TOUCHING:
        middle = (low + high) / 2
        low, high = (low, middle) if np.any(penetration(middle) > 0) else (middle, high)
    return low


def pressure(punch: RigidPunch, penetration: Array) -> Array:
    """Nominal pressure k g (1 + (g/f)^2) at penetrations g (...), not negative; k the stiffness, f the stiffening
    penetration."""
    return punch.stiffness * penetration * (1 + (penetration / punch.stiffening_penetration) ** 2)


def pressure_slope(punch: RigidPunch, penetration: Array) -> Array:
    """Derivative of `pressure` by the penetration (...); 0 where there is none."""
    return punch.stiffness * (penetration > 0) * (1 + 3 * (penetration / punch.stiffening_penetration) ** 2)


def penalty_energy_density(punch: RigidPunch, penetration: Array) -> Array:
    """Energy per reference area at penetrations g (...): the integral of `pressure` from 0."""
    return punch.stiffness / 2 * penetration**2 * (1 + (penetration / punch.stiffening_penetration) ** 2 / 2)


def energy(punch: RigidPunch, facets: Faces, at: ContactState) -> float:
    """Penalty energy over the reference surface."""
    return float(np.sum(facets.weight * penalty_energy_density(punch, at.penetration)))


def forces(punch: RigidPunch, facets: Faces, at: ContactState) -> tuple[Array, float]:
    """Derivatives of the energy by the facets' node positions (facets, p + 1, 2), or (facets, k, 3) in space, and by
    the depth (the reaction)."""
    return assemble_load(facets, pressure(punch, at.penetration)[..., None] * at.normal)


def complementary_forces(punch: RigidPunch, facets: Faces, at: ContactState) -> tuple[Array, float]:
    """As `forces`, of the complementary energy: pressure times penetration less the energy."""
    return assemble_load(facets, (pressure_slope(punch, at.penetration) * at.penetration)[..., None] * at.normal)


def assemble_load(facets: Faces, by_position: Array) -> tuple[Array, float]:
    """Derivatives, as of `forces`, of an integral from its integrand's by the position (facets, points, 2)."""
    push = facets.weight[..., None] * by_position
    return np.einsum("fpi,pa->fai", push, facets.shape), float(np.sum(push[..., -1]))


def stiffness(punch: RigidPunch, facets: Faces, at: ContactState,
              negative_curvature_scale: float = 1.0) -> tuple[Array, Array, float]:
    """Second derivatives of the energy: facet blocks (facets, p + 1, 2, p + 1, 2), border (facets, p + 1, 2), corner.
    The part with the punch's curvature, which is never positive, is scaled by negative_curvature_scale."""
    push, bend = pressure_slope(punch, at.penetration), pressure(punch, at.penetration) * negative_curvature_scale
    point = push[..., None, None] * at.normal[..., :, None] * at.normal[..., None, :]
    return assemble_stiffness(facets, point + bend[..., None, None] * at.curvature)


def assemble_stiffness(facets: Faces, by_position: Array) -> tuple[Array, Array, float]:
    """Second derivatives, as of `stiffness`, of an integral from its integrand's by the position
    (facets, points, 2, 2)."""
    point = facets.weight[..., None, None] * by_position
    blocks = np.einsum("fpij,pa,pb->faibj", point, facets.shape, facets.shape)
    return blocks, np.einsum("fpi,pa->fai", point[..., -1], facets.shape), float(np.sum(point[..., -1, -1]))
