"""Places as the nearest edge of a skin sees them: how near it is, and which way it lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surrogate.data import outlined_sheet
from surrogate.data.sensor_ring import Ring
from touchcal.arrays import Array, Complex, Index

LEAST = float(np.finfo(float).tiny ** 0.25)  # radius that a place in the middle of a disc is taken to have


@dataclass(frozen=True, eq=False)
class EdgeFrame:
    """Places and the directions towards the nearest edge, lengths over the radius of the ring."""

    z: Complex  # (n,) place from the origin
    radial: Array  # (n,) |z| on a disc, else 1 less the distance to the nearest edge over the largest one
    outwards: Complex  # (n,) unit direction towards that edge, along which `radial` grows: z / |z| on a disc
    turn: Array  # (n, 2) derivatives of the angle of that direction by x and y; 0 along a straight edge

    def some(self, kept: Index | slice) -> EdgeFrame:
        """Those of some places."""
        return EdgeFrame(self.z[kept], self.radial[kept], self.outwards[kept], self.turn[kept])


def edge_frame(ring: Ring, z: Complex) -> EdgeFrame:
    """The frames of places z (n,), whose nearest edge is part of the rim of the disc or a straight one."""
    if ring.sheet is None:
        radial, turn = np.abs(z), np.empty((len(z), 2))
        some = np.maximum(radial, LEAST)
        outwards = z / some
        turn[:, 0], turn[:, 1] = -outwards.imag / some, outwards.real / some
        return EdgeFrame(z, radial, outwards, turn)
    place_mm = ring.origin_mm + ring.radius_mm * np.column_stack([z.real, z.imag])
    distance, slope = outlined_sheet.edge_distance_mm(ring.sheet, place_mm)
    return EdgeFrame(z, 1 - distance / ring.radius_mm, -(slope[:, 0] + 1j * slope[:, 1]), np.zeros((len(z), 2)))
