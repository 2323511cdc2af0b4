"""How the skin's conductance changes with places, punches and cards, as seen from a mesh that moves with the touches.

A field that moves with a punch has its steepest slopes at the contact's edge, which no fixed mesh resolves. So the
mesh's nodes move with the punch, or with its edge where the diameter changes, with velocities v that vanish at the rim
and under electrodes. Then dS/dp is S' + S div v - S grad v' - grad v S, with S' the change seen by a node that moves;
the adjoint formula of `eitsim.electrics.cem.adjoint` with it is the exact derivative of the solution on the moving
mesh, whatever v.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.electrics.cem.assembly import Array, SkinMesh, gradients, quadrature_points
from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch, Skin
from eitsim.sheet.sheet_conductance import touched_conductance
from eitsim.simulation.derivatives.tangent import Settled, shifted, varied
from matcal.laws.conductivity import Conductivity

Touches = Sequence[tuple[Punch, Touch]]

_PLACE_MM, _COEFFICIENT = 1e-5, 1e-6  # Half the difference of places, mm, and of the skin's coefficients a.


@dataclass(frozen=True, eq=False)
class Variation:
    """Two states of a touched skin, on either side of one parameter."""

    name: str  # as in a data set, with its unit: "x_mm"
    step: float  # half the difference between both sides, in that unit
    # touches and skin on either side
    less: tuple[Touches, Conductivity]
    more: tuple[Touches, Conductivity]
    velocity: Array  # (n, 2) velocity of the mesh's nodes, m a unit


def variations(nodes_m: Array, bases: Sequence[Settled], law: Conductivity,
               rooms: Sequence[float]) -> Iterator[Variation]:
    """x_mm, y_mm, F_N or depth_mm, and d_mm of each touch (with _1, _2, ... where there are several), mu_i_Pa and
    alpha_i of the foam, a_1, ... of the skin; nodes (n, 2) of a mesh move with them, within radii, m, `rooms`,
    about the punches."""
    touches = [(base.punch, base.touch) for base in bases]
    sides, still = [list(varied(base)) for base in bases], np.zeros_like(nodes_m)
    for i, (own, room) in enumerate(zip(sides, rooms, strict=True)):
        suffix = f"_{i + 1}" if len(bases) > 1 else ""
        share = _share(nodes_m, *touches[i], room)
        for axis, direction in (("x", np.array([1.0, 0.0])), ("y", np.array([0.0, 1.0]))):
            less, more = (_with(touches, i, shifted(bases[i], by * 1e-3 * direction)) for by in (-_PLACE_MM, _PLACE_MM))
            yield Variation(f"{axis}_mm{suffix}", _PLACE_MM, (less, law), (more, law), 1e-3 * share * direction)
        for one in (v for v in own if not v.shared):
            velocity = 1e-3 * share * _with_edge(nodes_m, touches[i][0]) if one.name == "d_mm" else still
            yield Variation(one.name + suffix, one.step, (_with(touches, i, one.less), law),
                            (_with(touches, i, one.more), law), velocity)
    for every in zip(*([v for v in own if v.shared] for own in sides), strict=True):
        yield Variation(every[0].name, every[0].step, ([v.less for v in every], law), ([v.more for v in every], law),
                        still)
    for i, one in enumerate(_COEFFICIENT * np.eye(law.a.size)):
        less, more = (replace(law, a=law.a + sign * one) for sign in (-1, 1))
        yield Variation(f"a_{i + 1}", _COEFFICIENT, (touches, less), (touches, more), still)


def conductance_change(mesh: SkinMesh, skin: Skin, variation: Variation) -> Array:
    """dS/dp (cells, q, 2, 2), S a unit, at the quadrature points of a mesh that moves, with what its motion changes of
    the integrals."""
    low, high = (touched_conductance(quadrature_points(moved(mesh, variation.velocity, by)), touches, skin, law)
                 for by, (touches, law) in ((-variation.step, variation.less), (variation.step, variation.more)))
    by_place = gradients(mesh, variation.velocity)[0]
    sheet, spread = (low + high) / 2, np.trace(by_place, axis1=-2, axis2=-1)[..., None, None]
    turned = sheet @ by_place
    return (high - low) / (2 * variation.step) + spread * sheet - turned - turned.swapaxes(-1, -2)


def moved(mesh: SkinMesh, velocity: Array, by: float) -> SkinMesh:
    """The mesh with its nodes moved by that many units of a velocity (n, 2)."""
    return replace(mesh, nodes_m=mesh.nodes_m + by * velocity)


def _share(points_m: Array, punch: Punch, touch: Touch, room_m: float) -> Array:
    """Part (n, 1) of a punch's motion that points follow: all of it in its contact, none outside the room about it."""
    radius = np.hypot(*(points_m - np.array([punch.x_m, punch.y_m])).T)
    contact = max(punch.diameter_m / 2, touch.contact_radius_m)
    t = np.clip((radius - contact) / (room_m - contact), 0, 1)
    return (1 - t**2 * (3 - 2 * t))[:, None]


def _with_edge(points_m: Array, punch: Punch) -> Array:
    """Velocity (n, 2) by the diameter: half of it outwards from the start of the fillet on, in proportion inside."""
    offset = points_m - np.array([punch.x_m, punch.y_m])
    flat = max(punch.diameter_m / 2 - punch.fillet_m, punch.diameter_m / 4)
    return offset / 2 / np.maximum(np.hypot(*offset.T), flat)[:, None]


def _with(touches: Touches, i: int, touch: tuple[Punch, Touch]) -> list[tuple[Punch, Touch]]:
    return [touch if j == i else other for j, other in enumerate(touches)]
