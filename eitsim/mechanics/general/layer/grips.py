"""What a punch that sticks or rubs holds of a layer: the springs of the same punch alone, at the end of its way.

Edges, plates and other punches change a touch at the end of that way alone: what sticks there stays stuck, and what
slips does so under its largest shear (`eitsim.mechanics.contact.stick_springs`).
"""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.axisymmetric.indentation import IndentationProblem
from eitsim.mechanics.contact.friction import FrictionState
from eitsim.mechanics.contact.stick_springs import StickSprings
from eitsim.mechanics.general.meshing.wedge import Facets
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class Grip:
    """Springs of a punch alone at reference radii (n,), increasing, thicknesses."""

    radius: Array
    held: FrictionState  # (n,) each


def grip_of(model: IndentationProblem) -> Grip | None:
    """The springs of an axisymmetric touch; None where it has none."""
    if model.springs is None:
        return None
    held, order = model.springs, np.argsort(model.facets.radius.ravel())
    limit, slip = (part.ravel()[order] for part in (held.limit, held.slip))
    moved, along = (part.reshape(-1, 2)[order] for part in (held.moved, held.along))
    return Grip(model.facets.radius.ravel()[order], FrictionState(held.stiffness, limit, slip, moved, along))


def springs_on(grip: Grip, faces: Facets, nodes: Array, axis: Array) -> StickSprings:
    """The springs at the points of facets about an axis (2,), displacements along x, y and z."""
    away = (faces.shape @ nodes[faces.nodes][..., :2]).reshape(-1, 2) - axis
    radius, held = np.hypot(*away.T), grip.held
    outwards = away / np.maximum(radius, 1e-300)[:, None]
    there = held.limit > 0
    near = np.clip(np.searchsorted((grip.radius[1:] + grip.radius[:-1]) / 2, radius), 0, len(grip.radius) - 1)
    if not there.any():
        near, there = np.zeros_like(near), np.ones_like(there)

    def at(values: Array) -> Array:
        return np.interp(radius, grip.radius[there], values[there])

    flat, up = (at(held.along[:, i]) for i in (0, 1))
    direction = np.zeros((len(radius), 2, 3))
    direction[:, 0, :2], direction[:, 0, 2] = flat[:, None] * outwards, up
    direction[:, 1, :2] = np.column_stack([-outwards[:, 1], outwards[:, 0]])
    offset, most = np.zeros((len(radius), 2, 1)), np.full((len(radius), 2, 1), np.inf)
    offset[:, 0, 0] = at(held.slip - np.sum(held.along * held.moved, axis=-1))
    most[:, 0, 0] = held.limit[near] / held.stiffness
    stiffness = np.where(held.limit[near] > 0, held.stiffness, 0.0)
    sticks = np.abs(held.slip[near]) < most[:, 0, 0]
    return StickSprings(np.stack([stiffness, np.where(sticks, stiffness, 0.0)], axis=1)[..., None], most, direction,
                        offset)
