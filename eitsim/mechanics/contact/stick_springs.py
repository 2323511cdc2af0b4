"""Springs that hold the surface of a clipped disc where it sticks to the punch.

Each point of contact that is held in the axisymmetric touch of the same mesh keeps its anchor there. A spring of the
stiffness of `eitsim.mechanics.contact.friction` resists slip along the punch's profile, and another one slip around its
axis. Both are linear about the axisymmetric touch, so that where no circle is cut its equilibrium stays one.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.contact.friction import FrictionState
from touchcal.arrays import Array


@dataclass(frozen=True)
class StickSprings:
    """Springs at the points of the surface that the punch may touch."""

    stiffness: Array  # (facets points, 1) nominal shear over slip; 0 where nothing holds
    # (facets points, 2, 3) directions in the local frame: along the profile, outwards and up, and around the axis
    direction: Array
    offset: Array  # (facets points, 2, 1) slip along them where nothing has moved


def stick_springs(held: FrictionState | None, shape: tuple[int, ...]) -> StickSprings:
    """The springs of a punch that sticks, held at (facets, points); of that shape and no stiffness without one."""
    count = int(np.prod(shape))
    direction, offset = np.zeros((count, 2, 3)), np.zeros((count, 2, 1))
    direction[:, 1, 1] = 1.0
    if held is None:
        return StickSprings(np.zeros((count, 1)), direction, offset)
    kept = slice(shape[0])
    direction[:, 0, ::2] = held.along[kept].reshape(count, 2)
    offset[:, 0, 0] = (held.slip - np.sum(held.along * held.moved, axis=-1))[kept].ravel()
    stiffness = np.where(np.isinf(held.limit[kept]), held.stiffness, 0.0).reshape(count, 1)
    return StickSprings(stiffness, direction, offset)


def slip(held: StickSprings, seen: Array) -> Array:
    """Slip (facets points, 2, angles) where the foam has moved by seen (facets points, 3, angles) past the punch."""
    return held.direction @ seen + held.offset


def potential(held: StickSprings, seen: Array) -> Array:
    """Energy per reference area (facets points, angles)."""
    return held.stiffness / 2 * np.sum(slip(held, seen) ** 2, axis=1)


def pull(held: StickSprings, seen: Array) -> Array:
    """Derivative of the potential by the displacement (facets points, 3, angles)."""
    return held.stiffness[:, None] * (np.swapaxes(held.direction, 1, 2) @ slip(held, seen))


def tangent(held: StickSprings) -> Array:
    """Second derivative of the potential (facets points, 3, 3, 1)."""
    return (held.stiffness[:, None] * (np.swapaxes(held.direction, 1, 2) @ held.direction))[..., None]
