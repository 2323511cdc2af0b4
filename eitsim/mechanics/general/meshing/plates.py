"""Electrodes as bodies: which stretches of the skin's edge they hold."""

import numpy as np

from eitsim.scene.electrodes import Electrodes
from eitsim.scene.outline_edge import arcs_of, edge_starts
from eitsim.scene.scene import Body
from touchcal.arrays import Array


def plates_of(body: Body, electrodes: Electrodes) -> Array:
    """First and last arc lengths (k, 2), thicknesses, along the first loop of a body's edge, of plates that stand on
    the base and hold the side as high as the foam, as wide as line electrodes; none of soft ones, and of others."""
    if electrodes.soft or not electrodes.along_edge:
        return np.empty((0, 2))
    first, last = (arcs_of(body.edge, body.edge.along_m(ends))[0] for ends in body.edge.stretches_m(electrodes).T)
    last = np.where(last > first, last, last + edge_starts(body.edge)[-1])
    return np.column_stack([first, last]) / body.thickness_m
