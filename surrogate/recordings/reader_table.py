"""What a trained reader says of a recording, as a table: a row a touched frame."""

import pandas as pd

from eitsim.sensors.recording import Recording
from surrogate.recordings.presses import presses_of
from surrogate.recordings.touch_reader import read
from surrogate.recordings.train_reader import TrainedReader


def read_touches(model: TrainedReader, recording: Recording) -> pd.DataFrame:
    """A row a touched frame: `touch`, or `index` where no touch is named, x0_mm and y0_mm with the ends of their 90 %
    intervals, and a flag. The untouched frames of the recording are its tracked baseline."""
    presses = presses_of(recording)
    found = read(model.reader, presses)
    named = bool((presses.name != "").any())
    table = pd.DataFrame({"touch": presses.name} if named else {"index": presses.index})
    for axis, name in enumerate(("x0", "y0")):
        value, half = found.value[:, axis], found.half_width[:, axis]
        table[f"{name}_mm"], table[f"{name}_lo90_mm"], table[f"{name}_hi90_mm"] = value, value - half, value + half
    return table.assign(flag=found.flag)
