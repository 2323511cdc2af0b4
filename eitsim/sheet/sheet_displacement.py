"""How the skin moves under a touch."""

import math

import numpy as np
from scipy.interpolate import PchipInterpolator

from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch
from eitsim.sheet.sheet_conductance import local_axes, moved
from touchcal.arrays import Array


def displacement(points_m: Array, punch: Punch, touch: Touch) -> Array:
    """Displacement (n, 3), m, of points (n, 2) of the skin; 0 outside the touch's samples."""
    if touch.surface is not None:
        return touch.surface.displacement(points_m)
    axes = local_axes(punch, touch)
    local = (points_m - np.array([punch.x_m, punch.y_m])) @ axes.T
    radius = np.hypot(local[:, 0], local[:, 1])
    known = PchipInterpolator(touch.radius_m, np.column_stack([touch.u_r_m, touch.u_z_m]))
    outwards, upwards = np.where(radius[:, None] > touch.radius_m[-1], 0.0,
                                 known(np.clip(radius, *touch.radius_m[[0, -1]]))).T
    share = outwards / np.maximum(radius, math.ulp(0))
    found = np.column_stack([share * local[:, 0], share * local[:, 1], upwards])
    if touch.rim is not None:
        found = found + moved(touch.rim, local)
    return np.column_stack([found[:, :2] @ axes, found[:, 2]])
