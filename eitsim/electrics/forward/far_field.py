"""The strain beyond the rings, up to the rim: small, so its signal is taken to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import Array, gradients, potentials, quadrature_points
from eitsim.electrics.cem.ring_scattering import ring_share
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.electrics.sheet.sheet_conductance import sheet_conductance, touched_conductance
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Skin
from matcal.laws.conductivity import Conductivity

# Level of the rim's angles, rings of the fixed mesh and the width of the outermost one over the radius.
_LEVEL, _RINGS, _LAST = 2, 16, 4e-3


@dataclass(frozen=True, eq=False)
class _Untouched:
    """Fields of the untouched skin at quadrature points of a fixed mesh."""

    points_m: Array  # (n, 2) points, m
    area_m2: Array  # (n,) area of each, m^2
    gradient: Array  # (n, 2, count) gradients of the potential, Ohm/m, of 1 A into each electrode


@lru_cache(maxsize=8)
def _untouched(body: Body, electrodes: Electrodes, conductance_S: float) -> _Untouched:
    angles, electrode = rim_angles(body, electrodes, _LEVEL)
    radii = body.radius_m * np.append(1 - np.geomspace(1, _LAST, _RINGS), 1.0)
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, electrodes.count)
    potential = potentials(mesh, np.full(len(mesh.cells), conductance_S), contact_impedances(electrodes))
    gradient, area = gradients(mesh, potential[:len(mesh.nodes_m)])
    return _Untouched(quadrature_points(mesh).reshape(-1, 2), area.ravel(),
                      gradient.reshape(-1, 2, electrodes.count))


def born_correction(body: Body, electrodes: Electrodes, conductance_S: float, punch: Punch, touch: Touch, skin: Skin,
                    law: Conductivity, reach_m: float) -> Array:
    """Change (count, count), Ohm, of the impedance matrix by what the rings leave out: -int grad u_k . ds grad u_l,
    u the untouched fields, ds the change of conductance less `ring_share` of it."""
    field = _untouched(body, electrodes, conductance_S)
    radius = np.hypot(field.points_m[:, 0] - punch.x_m, field.points_m[:, 1] - punch.y_m)
    left = 1 - ring_share(radius, reach_m)
    far = (left > 0) & (radius < touch.radius_m[-1])
    change = sheet_conductance(field.points_m[far], punch, touch, skin, law) - conductance_S * np.eye(2)
    return _first_order(field, far, change * left[far, None, None])


def change_where_they_meet(body: Body, electrodes: Electrodes, conductance_S: float,
                           touches: Sequence[tuple[Punch, Touch]], skin: Skin, law: Conductivity) -> Array:
    """Change (count, count), Ohm, of the impedance matrix, to first order, by what touches make of the conductance
    together beyond the sum of what each makes alone, outside their contacts; 0 for one touch."""
    field = _untouched(body, electrodes, conductance_S)
    away = np.array([np.linalg.norm(field.points_m - [punch.x_m, punch.y_m], axis=1) for punch, _ in touches])
    inner, outer = (np.array([[radius] for radius in radii]) for radii in zip(*(
        (touch.contact_radius_m, touch.radius_m[-1]) for _, touch in touches), strict=True))
    outside = np.all(away > inner, axis=0) & (np.sum(away < outer, axis=0) > 1)
    points = field.points_m[outside]
    alone = [sheet_conductance(points, punch, touch, skin, law) for punch, touch in touches]
    rest = (len(touches) - 1) * conductance_S * np.eye(2)
    return _first_order(field, outside, touched_conductance(points, touches, skin, law) - np.sum(alone, axis=0) + rest)


def _first_order(field: _Untouched, at: NDArray[np.bool_], change: Array) -> Array:
    gradient = field.gradient[at]
    return -np.tensordot(gradient, change * field.area_m2[at, None, None] @ gradient, axes=([0, 1], [0, 1]))
