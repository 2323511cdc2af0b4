"""Where the electrodes lie on the rim."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eitsim.scene import Body, Electrodes

Array = NDArray[np.float64]


def arcs(body: Body, electrodes: Electrodes) -> Array:
    """First and last angle (count, 2), rad, of line electrodes along the rim, counter-clockwise.

    ValueError for patch electrodes, which are not built, and where neighbours touch.
    """
    if electrodes.kind != "line":
        raise ValueError(f"kind in [electrodes]: '{electrodes.kind}' is not built; use 'line', a contact on the rim.")
    half = electrodes.width_m / (2 * body.radius_m)
    pitch = 2 * np.pi / electrodes.count
    if not 0 < 2 * half < pitch:
        raise ValueError(f"electrodes of {electrodes.width_m * 1e3:g} mm leave no gap: {electrodes.count} share a "
                         f"rim of {2e3 * np.pi * body.radius_m:.1f} mm.")
    middle = electrodes.first_angle_rad + pitch * np.arange(electrodes.count)
    return middle[:, None] + half * np.array([-1.0, 1.0])
