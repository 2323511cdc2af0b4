"""The skin as the page draws it: a disc, its electrodes, and how many readings it makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eitsim.sensors.labels import PLACE
from surrogate.model.trained import TrainedModel
from surrogate.recordings.trained.train_reader import TrainedReader
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class Pictured:
    """A round skin seen from above."""

    centre_mm: Array  # (2,) of the disc, in the coordinates of places
    radius_mm: float
    electrodes_rad: Array  # (n,) angles of the electrodes on its rim; none where they are not known
    readings: int
    values: tuple[str, ...]  # what is read of a touch: labels with their units
    unit: str = "mV"  # of the readings as shown; "" where they are counts of a board


def pictured(model: TrainedModel | TrainedReader) -> Pictured:
    """The disc of a model of simulated touches; of a model of a recording, which knows no rim, the disc of the places
    that it tells from each other. ValueError for one that reads no place, or a skin with an outline."""
    if not isinstance(model, TrainedReader):
        if model.ring.sheet is not None:
            raise ValueError("the page draws round skins and presses them on a disc's map, and this model's skin has "
                             "an outline. Read frames as they come with `surrogate predict MODEL -`.")
        return Pictured(np.zeros(2), model.ring.radius_mm, model.ring.angle_rad, len(model.baseline_V),
                        ("x_mm", "y_mm", "d_mm", "F_N"))
    if model.reader.place is None:
        raise ValueError("this model reads no place, which the page shows. Train it on labels x_mm and y_mm.")
    places = model.reader.place.direction.places
    centre = (places.min(axis=0) + places.max(axis=0)) / 2
    return Pictured(centre, float(np.linalg.norm(places - centre, axis=1).max()), np.zeros(0),
                    model.reader.signals.channels, (*PLACE, *(one.name for one in model.reader.scalars)),
                    "mV" if model.kind == "voltage" else "")
