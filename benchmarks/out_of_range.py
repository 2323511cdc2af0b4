"""Whether signals stronger than all trained ones are flagged, and others are not, on recorded skins.

Usage: python benchmarks/out_of_range.py. Reads the recordings in ../shared/real, which others measured, and stops where
they are not there. LABELS presses teach, drawn from those of the first four fifths in time whose signals are in the
weaker half; the last fifth tests. Adds to results/out_of_range.csv the rows that it lacks: how many tested frames are
more than 1.2 times as strong as the strongest of them, and which part is flagged; likewise of those not stronger. The
strength is that of the readings of a press: those that a scan leaves to the frame that follows (`late_readings`), of
which the press's own row holds what was there before, are taken from there.
"""

from functools import partial

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from few_labels import placed
from real_skins import REAL, SKINS

from eitsim.sensors.labels import labels_of
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model.recorded import plain_reader
from surrogate.model.recorded.reader_scores import split_rows
from surrogate.recordings import press_reader
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.presses import taken

NAME = "out_of_range"
METHODS = quick(("ridge", "families"), ("ridge",))
LABELS, STRONGER = 100, 1.2


def measured(skin: str, method: str) -> dict[str, object]:
    """The row of a skin and a method."""
    presses, labels = placed(skin)
    early, last = split_rows(len(labels.touch), "time", 0)
    row_size = np.linalg.norm(presses.signal, axis=1)
    weak = early[row_size[early] < np.median(row_size[early])]
    rows = np.sort(np.random.default_rng(0).choice(weak, LABELS, replace=False))
    fit = partial(plain_reader.fit, "ridge") if method == "ridge" else partial(
        press_reader.fit, expectation=expectation_of(read_sensor(REAL / skin / "sensor.toml")))
    reader = fit(taken(presses, rows), labels_of(labels, rows), 0)
    size = np.linalg.norm(np.delete(reader.signals.whole(presses), reader.signals.late, axis=1), axis=1)
    flagged = press_reader.read(reader, taken(presses, last)).kinds > 0
    above, within = size[last] > STRONGER * size[rows].max(), size[last] <= size[rows].max()
    return {"skin": skin, "method": method, "labels": LABELS, "stronger": above.sum(),
            "stronger_flagged": flagged[above].mean(), "within": within.sum(), "within_flagged": flagged[within].mean()}


def main() -> None:
    if not REAL.is_dir():
        print(f"{REAL} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    done = {*zip(table["skin"], table["method"], strict=True)} if len(table) else set()
    for method in METHODS:
        for skin in SKINS:
            if (skin, method) not in done:
                row = pd.DataFrame([measured(skin, method)])
                shown(row)
                table = written(pd.concat([table, row], ignore_index=True), NAME)


if __name__ == "__main__":
    main()
