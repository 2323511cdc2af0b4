"""A touched layer in three dimensions, whatever its electrodes: its conductivity at any place, and the change dZ."""

from collections.abc import Sequence

import numpy as np

from eitsim.electrics.cem.assembly import SkinMesh
from eitsim.electrics.volume.extruded_mesh import extruded, graded_heights
from eitsim.electrics.volume.volume_cem import volume_dissection, volume_impedance, volume_points
from eitsim.mechanics.solid.section_gradient import gradient_at
from eitsim.scene.pressing import Skin
from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch
from eitsim.sheet.layer_conductivity import referred_conductivity
from matcal.laws.conductivity import Conductivity
from touchcal.arrays import Array

Touches = Sequence[tuple[Punch, Touch]]


def layer_deformation(touches: Touches, points_m: Array) -> Array:
    """F (..., 3, 3) at places (..., 3), m, of an untouched layer whose top is at 0: one touch's, or the products of
    several's, which lie far from each other."""
    gradient = np.broadcast_to(np.eye(3), (*points_m.shape[:-1], 3, 3))
    for punch, touch in touches:
        assert touch.section is not None
        offset = points_m[..., :2] - np.array([punch.x_m, punch.y_m])
        radius = np.hypot(offset[..., 0], offset[..., 1])
        cos, sin = np.moveaxis(np.where(radius[..., None] > 0, offset / np.maximum(radius, 1e-300)[..., None],
                                        [1.0, 0.0]), -1, 0)
        none = np.zeros_like(cos)
        # columns: the directions along r, z and around
        axes = np.stack([np.stack([cos, none, -sin], -1), np.stack([sin, none, cos], -1),
                         np.stack([none, none + 1, none], -1)], axis=-2)
        gradient = axes @ gradient_at(touch.section, radius, points_m[..., 2]) @ np.swapaxes(axes, -1, -2) @ gradient
    return gradient


def layer_change(mesh: SkinMesh, skin: Skin, law: Conductivity, touches: Touches, contact_impedance_Ohm_m2: Array, *,
                 layers: int = 6, place: str = "rim", between_m: tuple[float, float] | None = None
                 ) -> tuple[Array, Array]:
    """Impedance matrices (N, N), Ohm, of an untouched layer, and what touches change of it, on one mesh.

    The flat mesh is drawn through the thickness in so many layers, electrodes as of `extruded`; contact impedances (N,)
    in Ohm m^2. NotPositive where the conductivity is not positive.
    """
    body = extruded(mesh, graded_heights(skin.thickness_m, layers, between_m), place, between_m)
    order = volume_dissection(body)
    rest = volume_impedance(body, np.full(len(body.cells), law.c0_S_per_m), contact_impedance_Ohm_m2, order=order)
    sigma = referred_conductivity(law, skin, layer_deformation(touches, volume_points(body)))
    return rest, volume_impedance(body, sigma, contact_impedance_Ohm_m2, order=order) - rest
