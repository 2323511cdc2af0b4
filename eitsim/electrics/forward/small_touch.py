"""What a small touch changes of the impedance matrix, to first order: dZ_ij = -S A grad(u_i) . grad(u_j) at its place.

u_i is the potential by 1 A into electrode i, S the sheet conductance, and A, m^2, the relative change of conductance
over the area of the touch.
"""

import numpy as np

from eitsim.electrics.forward.skins import skin_of
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.scene.channels import Channels, channel_changes
from eitsim.scene.drive import Protocol
from eitsim.scene.scene import Body, Electrodes
from touchcal.arrays import Array


def impedance_by_touch(body: Body, electrodes: Electrodes, conductance_S: float, places_m: Array) -> Array:
    """dZ/dA (places, N, N), Ohm/m^2, of line electrodes that all have contact, at places (places, 2) on the skin;
    ValueError as `solve_rim`."""
    slope = skin_of(body, electrodes, conductance_S).slopes(places_m)
    return -conductance_S * np.real(slope[:, :, None] * slope[:, None, :].conj())


def signal_by_touch(body: Body, electrodes: Electrodes, conductance_S: float, channels: Channels, asked: Protocol,
                    places_m: Array) -> Array:
    """dV/dA (places, readings), V/m^2, of a protocol through channels, pattern by pattern."""
    before = untouched_impedance(body, electrodes, conductance_S)
    by = impedance_by_touch(body, electrodes, conductance_S, places_m)
    return channel_changes(asked, channels, before, before, by).reshape(len(by), -1)
