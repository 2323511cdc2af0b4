"""The strain outside the rings, up to the rim: small, so its signal is taken to first order."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from eitsim.electrics.cem.assembly import Array, SkinMesh, gradients, potentials, quadrature_points
from eitsim.electrics.cem.ring_scattering import ring_share
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.electrics.outline.touch_mesh import fields_mesh
from eitsim.electrics.sheet.sheet_conductance import sheet_conductance, touched_conductance
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.outline import area_m2
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Skin
from matcal.laws.conductivity import Conductivity

# Level of the rim's angles, rings of the fixed mesh and the width of the outermost one over the radius.
_LEVEL, _RINGS, _LAST = 2, 16, 4e-3
# Triangles of a skin with an outline, about.
_TRIANGLES = 2000


@lru_cache(maxsize=8)
def _untouched(body: Body, electrodes: Electrodes, conductance_S: float) -> tuple[Array, Array, Array]:
    """Quadrature points (n, 2), m, of a fixed mesh, their areas (n,), m^2, and gradients (n, 2, count), Ohm/m, of the
    untouched potential of 1 A into each electrode."""
    mesh = _mesh(body, electrodes, conductance_S)
    potential = potentials(mesh, np.full(len(mesh.cells), conductance_S), contact_impedances(electrodes))
    gradient, area = gradients(mesh, potential[:len(mesh.nodes_m)])
    return quadrature_points(mesh).reshape(-1, 2), area.ravel(), gradient.reshape(-1, 2, electrodes.count)


def _mesh(body: Body, electrodes: Electrodes, conductance_S: float) -> SkinMesh:
    if body.has_outline:
        return fields_mesh(body, electrodes, conductance_S, area_m2(body.shape) / _TRIANGLES)
    angles, electrode = rim_angles(body, electrodes, _LEVEL)
    radii = body.radius_m * np.append(1 - np.geomspace(1, _LAST, _RINGS), 1.0)
    return ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, electrodes.count)


def born_correction(body: Body, electrodes: Electrodes, conductance_S: float, punch: Punch, touch: Touch, skin: Skin,
                    law: Conductivity, reach_m: float) -> Array:
    """Change (count, count), Ohm, of the impedance matrix by what the rings leave out: -int grad u_k . ds grad u_l,
    u the untouched fields, ds the change of conductance less `ring_share` of it."""
    points, area, gradient = _untouched(body, electrodes, conductance_S)
    radius = np.hypot(points[:, 0] - punch.x_m, points[:, 1] - punch.y_m)
    left = 1 - ring_share(radius, reach_m)
    far = (left > 0) & (radius < touch.radius_m[-1])
    change = sheet_conductance(points[far], punch, touch, skin, law) - conductance_S * np.eye(2)
    return _first_order(area[far], gradient[far], change * left[far, None, None])


def change_where_they_meet(body: Body, electrodes: Electrodes, conductance_S: float,
                           touches: Sequence[tuple[Punch, Touch]], skin: Skin, law: Conductivity) -> Array:
    """Change (count, count), Ohm, of the impedance matrix, to first order, by what touches make of the conductance
    together more than the sum of what each makes alone, outside their contacts; 0 for one touch."""
    points, area, gradient = _untouched(body, electrodes, conductance_S)
    away = np.array([np.linalg.norm(points - [punch.x_m, punch.y_m], axis=1) for punch, _ in touches])
    inner = np.array([[touch.contact_radius_m] for _, touch in touches])
    outer = np.array([[touch.radius_m[-1]] for _, touch in touches])
    outside = np.all(away > inner, axis=0) & (np.sum(away < outer, axis=0) > 1)
    points = points[outside]
    alone = [sheet_conductance(points, punch, touch, skin, law) for punch, touch in touches]
    rest = (len(touches) - 1) * conductance_S * np.eye(2)
    change = touched_conductance(points, touches, skin, law) - np.sum(alone, axis=0) + rest
    return _first_order(area[outside], gradient[outside], change)


def _first_order(area: Array, gradient: Array, change: Array) -> Array:
    return -np.tensordot(gradient, change * area[:, None, None] @ gradient, axes=([0, 1], [0, 1]))
