"""Electrodes as bodies: plates that hold the side of a layer, and pads that are bonded to its surface."""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.edges.electrode_outlines import outlines_m
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.outline_edge import arcs_of, edge_starts, places_along
from eitsim.scene.polygons import distance_to
from eitsim.scene.scene import Body
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class Pad:
    """A pad on the surface."""

    outline: Array  # (n, 2) corners, the first one again at the end
    line: Array  # (m, 2) what of that does not lie on the edge of the skin, closed or from edge to edge
    ends: Array  # (2,) arc lengths along the edge at which that line begins and ends; (0,) of a closed one


@dataclass(frozen=True, eq=False)
class Bodies:
    """What is bonded to a layer, lengths in thicknesses along the first loop of its edge and on its surface."""

    plates: Array  # (k, 2) first and last arc lengths of plates that hold the side
    pads: tuple[Pad, ...] = ()

    @property
    def ends(self) -> Array:
        """(n,) arc lengths at which something ends on the edge."""
        return np.concatenate([self.plates.ravel(), *(pad.ends for pad in self.pads)])


NO_BODIES = Bodies(np.empty((0, 2)))


def bodies_of(body: Body, electrodes: Electrodes, places_m: Array, least_m: Array) -> Bodies:
    """Line electrodes as plates that stand on the base and hold the side as high as the foam, others as pads; without
    pads that are no further than `least_m` (n,) from places (n, 2), m; none of soft ones."""
    if electrodes.soft:
        return NO_BODIES
    unit, whole = body.thickness_m, edge_starts(body.edge)[-1]
    if electrodes.along_edge:
        return Bodies(_arcs(body, body.edge.stretches_m(electrodes)) / unit)
    outlines = outlines_m(body.edge, electrodes)
    clear = [all(distance_to(outline, place) > least for place, least in zip(places_m, least_m, strict=True))
             for outline in outlines]
    if not electrodes.at_rim:
        return Bodies(np.empty((0, 2)), tuple(Pad(outline / unit, outline / unit, np.empty(0))
                                              for outline, free in zip(outlines, clear, strict=True) if free))
    pads = []
    for outline, ends, free in zip(outlines, _arcs(body, body.edge.stretches_m(electrodes)), clear, strict=True):
        if free:
            inner = outline[len(outline) // 2:-1][::-1] / unit
            along = places_along(body.edge, np.linspace(ends[0], ends[1], len(inner))) / unit
            pads.append(Pad(np.vstack([along, inner[::-1], along[:1]]), np.vstack([along[:1], inner, along[-1:]]),
                            np.mod(ends, whole) / unit))
    return Bodies(np.empty((0, 2)), tuple(pads))


def _arcs(body: Body, stretches_m: Array) -> Array:
    """First and last arc length (k, 2), m, along the first loop of a body's edge."""
    first, last = (arcs_of(body.edge, body.edge.along_m(ends))[0] for ends in stretches_m.T)
    return np.column_stack([first, np.where(last > first, last, last + edge_starts(body.edge)[-1])])
