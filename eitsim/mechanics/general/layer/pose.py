"""A punch's pose in space: upright on the skin, or leaning, and where it begins to touch."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from eitsim.mechanics.contact.punch_contact import spatial_penetration, touching_depth
from eitsim.mechanics.general.layer.equilibrium_of_many import Pose, Press
from eitsim.mechanics.general.meshing.layer_layout import FLAT, Layout
from eitsim.scene.scene import Punch

# Directions and radii of the places by which first touch is found, and how far outside the punch they go, thicknesses.
_DIRECTIONS, _RADII, _OUTSIDE = 96, 300, 0.3


def posed(press: Press, punch: Punch, layout: Layout) -> Press:
    """The punch with its axis along the normal of the place under it, or leaning as it says, and its depth counted from
    first touch; an upright one on a flat layer as it is."""
    if layout is FLAT and punch.tilt_rad == 0 and press.rigid.shape is None:
        return press
    place, turn = layout.place(press.axis)[0], layout.turn(press.axis)
    across = turn @ [-np.sin(punch.tilt_direction_rad), np.cos(punch.tilt_direction_rad), 0.0]
    axes = (Rotation.from_rotvec(punch.tilt_rad * across).as_matrix() @ turn).T
    stood = replace(press, pose=Pose(place, axes))
    angle = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    radius = (press.rigid.profile.radius + _OUTSIDE) * np.arange(_RADII) / (_RADII - 1)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points, _ = layout.place(press.axis + radius[:, None, None] * way)
    first = touching_depth(lambda depth: spatial_penetration(press.rigid, stood.seen(points, depth)))
    return replace(stood, pose=Pose(place, axes, first))
