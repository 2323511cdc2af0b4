"""What a small touch changes of the impedance matrix, to first order: dZ_ij = -S A grad(u_i) . grad(u_j) at its place.

u_i is the potential by 1 A into electrode i, S the sheet conductance, and A, m^2, the relative change of conductance
over the area of the touch.
"""

import numpy as np

from eitsim.electrics.cem.boundary_integral import HARMONICS, Complex, solve_rim
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.outline.edge_response import arriving, edge_responses
from eitsim.scene.channels import Channels, channel_changes
from eitsim.scene.drive import Protocol
from eitsim.scene.scene import Body, Electrodes
from touchcal.arrays import Array


def impedance_by_touch(body: Body, electrodes: Electrodes, conductance_S: float, places_m: Array) -> Array:
    """dZ/dA (places, N, N), Ohm/m^2, of line electrodes that all have contact, at places (places, 2) on the skin;
    ValueError as `solve_rim`."""
    slope = _slopes(body, electrodes, conductance_S, places_m)
    return -conductance_S * np.real(slope[:, :, None] * slope[:, None, :].conj())


def _slopes(body: Body, electrodes: Electrodes, conductance_S: float, places_m: Array) -> Complex:
    """(places, N) u_x - i u_y, V/m."""
    if body.has_outline:
        circles = [(complex(x, y), 1.0) for x, y in places_m]
        return arriving(edge_responses(body.shape, electrodes, conductance_S)[0], circles, 1)
    driven = solve_rim(body, electrodes, conductance_S).driven
    start = electrodes.first_angle_rad
    point = (places_m[:, 0] + 1j * places_m[:, 1]) * np.exp(-1j * start) / body.radius_m
    order = np.arange(1, HARMONICS + 1)
    slope = point[:, None] ** (order - 1) @ (order[:, None] * driven) / body.radius_m
    return slope * np.exp(-1j * start)


def signal_by_touch(body: Body, electrodes: Electrodes, conductance_S: float, channels: Channels, asked: Protocol,
                    places_m: Array) -> Array:
    """dV/dA (places, readings), V/m^2, of a protocol through channels, pattern by pattern."""
    before = untouched_impedance(body, electrodes, conductance_S)
    return np.stack([channel_changes(asked, channels, before, before, one).ravel()
                     for one in impedance_by_touch(body, electrodes, conductance_S, places_m)])
