"""What a trained reader says of a recording, as a table: a row a touched frame."""

from dataclasses import replace

import pandas as pd

from eitsim.sensors.labels import PLACE
from eitsim.sensors.recording import Recording
from surrogate.data.outputs import lowest
from surrogate.recordings.presses import Presses, presses_of
from surrogate.recordings.trained.press_reader import read
from surrogate.recordings.trained.train_reader import TrainedReader
from touchcal.arrays import Array

OUTPUTS = {"x_mm": "x0_mm", "y_mm": "y0_mm"}  # labels whose outputs have another name
COORDINATES = (*PLACE, "z_mm")  # labels that may be below 0


def read_touches(model: TrainedReader, recording: Recording) -> pd.DataFrame:
    """A row a touched frame: `touch`, or `index` where no touch is named, each label that is learnt, as x0_mm, y0_mm,
    d_mm, F_N, depth_mm or z_mm, with the ends of its 90 % interval, as x0_lo90_mm and x0_hi90_mm, and a flag. Of a
    place, x0_y0_correlation and x0_y0_ellipse90 make its 90 % ellipse, as surrogate.recordings.intervals says. The
    untouched frames of the recording are its tracked baseline. ValueError where the model knows the cost of age in
    seconds and the recording has no clock; of one that knows it in frames, the recording's clock is left out."""
    presses = presses_read(model, recording)
    found = read(model.reader, presses)
    named = bool((presses.name != "").any())
    table = pd.DataFrame({"touch": presses.name} if named else {"index": presses.index})
    if found.place:
        for axis, name in enumerate(PLACE):
            _add(table, name, found.place.value[:, axis], found.place.bounds.half_width[:, axis])
        table["x0_y0_correlation"] = found.place.bounds.correlation
        table["x0_y0_ellipse90"] = found.place.bounds.ellipse
    for one in found.scalars:
        _add(table, one.name, one.value, one.half_width)
    return table.assign(flag=found.flag)


def presses_read(model: TrainedReader, recording: Recording) -> Presses:
    """The presses of a recording with ages as the model knows them; ValueError as of `read_touches`."""
    clocked = model.reader.signals.clocked
    if clocked and recording.time_s is None and recording.kind != "difference":
        raise ValueError(f"{recording.source}: it has no column time_s, and the model was trained on a recording with "
                         "one, so that the ages of untouched frames cannot be compared. Add time_s, or train on a "
                         "recording without it.")
    return presses_of(recording if clocked else replace(recording, time_s=None))


def _add(table: pd.DataFrame, label: str, value: Array, half_width: Array) -> None:
    name = OUTPUTS.get(label, label)
    stem, _, unit = name.rpartition("_")
    table[name], table[f"{stem}_lo90_{unit}"] = value, lowest(value, half_width, label not in COORDINATES)
    table[f"{stem}_hi90_{unit}"] = value + half_width
