"""Friction between foam and punch: a spring along the punch's profile at each point of contact, which may slip.

The slip q of a point is the arc of the profile nearest to it less its anchor, the arc at which it touched first or came
to rest. While an energy is minimised the direction of the profile and the largest shear T are kept, so that each point
adds a convex potential: k q^2/2 up to the slip T/k, T |q| - T^2/(2 k) from there on. T is infinite where the punch
sticks, by Coulomb's law the coefficient times the nominal pressure. Source: Wriggers, Computational Contact Mechanics,
2nd ed. (2006), chapters 5 and 10, DOI 10.1007/978-3-540-32609-0.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.punch_contact import Facets, RigidPunch
from eitsim.scene.scene import Punch
from touchcal.arrays import Array

# Stiffness of the springs over that of the contact: ten times as much moves depths by less than 1e-4.
_STIFFNESS = 0.1


@dataclass(frozen=True)
class Nearest:
    """Points of the punch's profile that are nearest to the Gauss points (facets, points) of the foam's top."""

    penetration: Array  # depth inside the punch, negative outside
    arc: Array  # arc of the profile from the axis
    along: Array  # (facets, points, 2) direction (r, z) of the profile, outwards and up


@dataclass(frozen=True)
class FrictionState:
    """Springs along the punch's profile at the Gauss points (facets, points) during one minimisation."""

    stiffness: float  # nominal shear over slip, while it sticks
    limit: Array  # (facets, points) largest nominal shear; infinite where the punch sticks, 0 where nothing holds
    slip: Array  # (facets, points) slip from the anchor where the displacement is `moved`
    moved: Array  # (facets, points, 2) displacement as seen from the punch
    along: Array  # (facets, points, 2) direction (r, z) of the profile, outwards and up


@dataclass(frozen=True)
class Shear:
    """State of the springs, each (facets, points)."""

    potential: Array  # potential per reference area
    size: Array  # nominal shear; positive pulls the foam inwards
    slope: Array  # its derivative by the slip: the spring's stiffness, 0 where it slips
    slipped: Array  # size of the slip that the spring does not take up


def coefficient(punch: Punch) -> float:
    """Largest shear over pressure: 0 without friction, infinite where the punch sticks."""
    return {"none": 0.0, "stick": np.inf, "coulomb": punch.friction_coefficient}[punch.friction]


def stiffness(punch: RigidPunch) -> float:
    """Stiffness of the springs, nominal shear over slip."""
    return _STIFFNESS * punch.stiffness


def nearest(punch: RigidPunch, facets: Facets, position: Array, depth: float) -> Nearest:
    """Where the Gauss points of nodes at `position` (nodes, 2) stand on the punch, whose tip is `depth` below z = 0."""
    r, z = np.moveaxis(facets.shape @ position[facets.nodes], -1, 0)
    penetration, n_r, n_z, _, _ = punch.profile.signed_distance(r, z + depth)
    return Nearest(penetration, punch.profile.arc_length(r, z + depth), np.stack([n_z, -n_r], axis=-1))


def moved(facets: Facets, displacement: Array, depth: float) -> Array:
    """Displacement (facets, points, 2), as seen from the punch, of nodes displaced by (nodes, 2)."""
    return facets.shape @ displacement[facets.nodes] + np.array([0.0, depth])


def shear(springs: FrictionState, seen: Array) -> Shear:
    """State of the springs where the foam has `moved` by seen (facets, points, 2)."""
    slip = springs.slip + np.sum(springs.along * (seen - springs.moved), axis=-1)
    size, most = np.abs(slip), springs.limit / springs.stiffness
    elastic = np.minimum(size, most)
    return Shear(springs.stiffness * elastic * (size - elastic / 2), springs.stiffness * elastic * np.sign(slip),
                 np.where(size < most, springs.stiffness, 0.0), size - elastic)


def energy(springs: FrictionState, facets: Facets, seen: Array) -> float:
    """Potential of the springs over the reference surface."""
    return float(np.sum(facets.weight * shear(springs, seen).potential))


def forces(springs: FrictionState, facets: Facets, seen: Array, *, elastic: bool = False) -> tuple[Array, float]:
    """Derivatives of the energy as of punch.forces; elastic: of what the springs store, so without those that slip."""
    at = shear(springs, seen)
    size = np.where(at.slope > 0, at.size, 0.0) if elastic else at.size
    return contact.assemble_load(facets, size[..., None] * springs.along)


def tangent(springs: FrictionState, facets: Facets, seen: Array, share: float = 1.0) -> tuple[Array, Array, float]:
    """Second derivatives of the energy as of punch.stiffness, never negative; of what slips the rest of a share of 1 in
    the slope of the parabola through the shear that lies above the potential, so that steps do not turn slips back."""
    at = shear(springs, seen)
    above = np.abs(at.size) / np.maximum(at.slipped + np.abs(at.size) / springs.stiffness, np.finfo(float).tiny)
    slope = np.where(at.slope > 0, at.slope, (1 - share) * above)[..., None, None]
    return contact.assemble_stiffness(facets, slope * springs.along[..., :, None] * springs.along[..., None, :])
