"""Springs that hold the surface of a clipped disc where it sticks to the punch, or rubs on it.

Each point of contact that is held in the axisymmetric touch of the same mesh keeps its anchor there. A spring of
`eitsim.mechanics.contact.friction`, with the largest shear that it had there, resists slip along the punch's profile.
Where that one sticks, another one resists slip around its axis. Both are in balance with the axisymmetric touch, so
that where no circle is cut its equilibrium stays one.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.contact.friction import FrictionState
from touchcal.arrays import Array


@dataclass(frozen=True)
class StickSprings:
    """Springs at the points of the surface that the punch may touch."""

    # (facets points, 2, 1) nominal shear over slip along the profile and around the axis; 0 where nothing holds
    stiffness: Array
    most: Array  # (facets points, 2, 1) slip that either takes up before it slips; infinite where it sticks
    # (facets points, 2, 3) directions in the local frame: along the profile, outwards and up, and around the axis
    direction: Array
    offset: Array  # (facets points, 2, 1) slip along them where nothing has moved


def stick_springs(held: FrictionState | None, shape: tuple[int, ...]) -> StickSprings:
    """The springs of a punch that rubs, held at (facets, points); of that shape and no stiffness without one."""
    count = int(np.prod(shape))
    direction, offset = np.zeros((count, 2, 3)), np.zeros((count, 2, 1))
    stiffness, most = np.zeros((count, 2, 1)), np.full((count, 2, 1), np.inf)
    direction[:, 1, 1] = 1.0
    if held is None:
        return StickSprings(stiffness, most, direction, offset)
    kept = slice(shape[0])
    direction[:, 0, ::2] = held.along[kept].reshape(count, 2)
    offset[:, 0, 0] = (held.slip - np.sum(held.along * held.moved, axis=-1))[kept].ravel()
    limit = held.limit[kept].ravel()
    most[:, 0, 0] = limit / held.stiffness
    stiffness[:, 0, 0] = np.where(limit > 0, held.stiffness, 0.0)
    stiffness[:, 1, 0] = np.where(np.abs(held.slip[kept].ravel()) < most[:, 0, 0], held.stiffness, 0.0)
    return StickSprings(stiffness, most, direction, offset)


def slip(held: StickSprings, seen: Array) -> Array:
    """Slip (facets points, 2, angles) where the foam has moved by seen (facets points, 3, angles) past the punch."""
    return held.direction @ seen + held.offset


def potential(held: StickSprings, seen: Array) -> Array:
    """Energy per reference area (facets points, angles)."""
    size = np.abs(slip(held, seen))
    elastic = np.minimum(size, held.most)
    return np.sum(held.stiffness * elastic * (size - elastic / 2), axis=1)


def pull(held: StickSprings, seen: Array, *, elastic: bool = False) -> Array:
    """Derivative of the potential by the displacement (facets points, 3, angles); elastic: without what slips."""
    size = slip(held, seen)
    taken = np.where(np.abs(size) < held.most, size, 0.0 if elastic else np.clip(size, -held.most, held.most))
    return np.swapaxes(held.direction, 1, 2) @ (held.stiffness * taken)


def tangent(held: StickSprings, seen: Array, share: float = 1.0) -> Array:
    """Second derivative of the potential (facets points, 3, 3, angles). Of what slips, where that is none, the rest of
    a share of 1 in the slope of the parabola through the pull that lies above the potential: steps along it never
    leave a slip behind that turns back."""
    size = np.maximum(np.abs(slip(held, seen)), np.finfo(float).tiny)
    slope = np.where(size < held.most, held.stiffness, (1 - share) * held.stiffness * np.minimum(held.most / size, 1.0))
    return np.einsum("fsi,fsa,fsj->fija", held.direction, slope, held.direction)
