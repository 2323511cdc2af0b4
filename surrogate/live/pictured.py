"""The skin as the page draws it: its edges, its electrodes, and how many readings it makes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eitsim.sensors.labels import PLACE
from surrogate.data.sensor_ring import Ring
from surrogate.data.skin_edges import Circle, Edges, Polygons
from surrogate.data.skin_from_above import SkinFromAbove, skin_of_sheet
from surrogate.forward_map.known_places import alone_mm
from surrogate.learners.forward import TouchInversion
from surrogate.model.model import Model
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.trained import TrainedModel
from touchcal.arrays import Array

# Half the angle that an electrode of a disc is drawn over, rad, and points along it; distance of its number from the
# edge, over the radius of the disc or half the longer side of the box about another skin.
_HALF_RAD, _POINTS, _OUT = 0.05, 9, 0.075


@dataclass(frozen=True, eq=False)
class Drawn:
    """One electrode."""

    along_mm: Array  # (n, 2) points along it; of a patch the first is the last, too
    label_mm: Array  # (2,) place of its number


@dataclass(frozen=True, eq=False)
class Pictured:
    """A flat skin seen from above."""

    edges: Edges  # in the coordinates of places
    electrodes: tuple[Drawn, ...]  # none where they are not known
    readings: int
    values: tuple[str, ...]  # what is read of a touch: labels with their units
    unit: str = "mV"  # of the readings as shown; "" where they are counts of a board

    def document(self) -> dict[str, Any]:
        """Edges and electrodes as JSON."""
        return self.edges.document() | {"electrodes": [
            {"along_mm": np.round(one.along_mm, 4).tolist(), "label_mm": np.round(one.label_mm, 4).tolist()}
            for one in self.electrodes]}


def pictured(model: Model) -> Pictured:
    """The skin of a model of simulated touches; of a model of a recording the skin that its sensor file describes with
    an outline, else the disc of the places that it tells from each other. ValueError for one that reads no place, and
    for a curved skin."""
    if not isinstance(model, PressModel):
        if model.ring.curved is not None:
            raise ValueError("the page draws a flat skin from above, and this model's is curved. Read its frames with "
                             "`surrogate predict`.")
        return Pictured(edges_of(model), _electrodes_of(model.ring), len(model.baseline_V),
                        ("x_mm", "y_mm", "d_mm", "F_N"))
    reader, place = model.of_places
    places = place.direction.places
    about = (*PLACE, *(one.name for one in reader.scalars)), "mV" if model.kind == "voltage" else ""
    if model.skin is not None:
        return Pictured(Polygons(model.skin.loops_mm), _drawn(model.skin), reader.signals.channels,
                        *about)
    x, y = ((places.min(axis=0) + places.max(axis=0)) / 2).tolist()
    radius = float(np.linalg.norm(places - (x, y), axis=1).max())
    return Pictured(Circle((x, y), radius), (), reader.signals.channels, *about)


def edges_of(model: TrainedModel) -> Edges:
    """The edges of a surrogate's skin, and how near to one of two edges its map knows no touch."""
    ring = model.ring
    if ring.sheet is None:
        return Circle((0.0, 0.0), ring.radius_mm)
    known = model.learner.forward.near_edges if isinstance(model.learner, TouchInversion) else None
    alone = 0.0 if known is None else alone_mm(ring, known.far)
    return Polygons(skin_of_sheet(ring.sheet).loops_mm, alone)


def _electrodes_of(ring: Ring) -> tuple[Drawn, ...]:
    if ring.sheet is not None:
        return _drawn(skin_of_sheet(ring.sheet))
    angle = ring.angle_rad[:, None] + np.linspace(-_HALF_RAD, _HALF_RAD, _POINTS)
    along = ring.radius_mm * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    label = (1 + _OUT) * ring.radius_mm * np.column_stack([np.cos(ring.angle_rad), np.sin(ring.angle_rad)])
    return tuple(map(Drawn, along, label))


def _drawn(skin: SkinFromAbove) -> tuple[Drawn, ...]:
    """Electrodes of a skin with an outline: numbers stand outside its edge, or in the middle of a patch."""
    out = _OUT * float(np.ptp(skin.loops_mm[0], axis=0).max()) / 2
    return tuple(Drawn(one, one[:-1].mean(axis=0) if np.array_equal(one[0], one[-1]) else _outside(one, out))
                 for one in skin.electrodes_mm)


def _outside(along: Array, out_mm: float) -> Array:
    """The place so far to the right of the middle of a line (n, 2), which goes about the skin counter-clockwise."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(along, axis=0), axis=1))])
    middle = np.array([np.interp(lengths[-1] / 2, lengths, along[:, k]) for k in (0, 1)])
    way = (along[-1] - along[0]) / np.linalg.norm(along[-1] - along[0])
    return middle + out_mm * np.array([way[1], -way[0]])
