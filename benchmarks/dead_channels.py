"""Presses on real skins, some of whose readings are dead for good, read by models that were taught all of them.

Usage: python benchmarks/dead_channels.py [labels ...]. Reads the recordings in ../shared/real, which others measured,
and stops where they are not there. Labels are drawn as in few_labels.py; the last fifth in time tests, with one, five
or half of the readings dead in all frames, or all that one or two electrodes drive or read, drawn by the draw. Adds to
results/dead_channels.csv the rows that it lacks: means over `draws`, `readings` of them dead; error_mm is the mean
distance, said_mm what the model says of it by its training presses, worst_mm the largest of any draw; x_in_90 and
y_in_90 what the 90 % intervals hold of all frames, least_in_90 the least of both in any draw; flagged the part of the
frames with a flag; `holds` the part of the draws in which `surrogate audit` vouches for the intervals.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace

import few_labels
import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from real_skins import REAL, SKINS, recorded

from eitsim.sensors.labels import Labels, labels_of
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.recorded.reader_evaluation import evaluate_predictions
from surrogate.model.recorded.reader_scores import split_rows
from surrogate.recordings import press_reader
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.press_reader import PressReader, without_channels
from surrogate.recordings.presses import taken
from surrogate.recordings.worth import distance
from touchcal.arrays import Mask

NAME = "dead_channels"
DRAWS = quick({20: 5, 100: 3}, {20: 1})  # by the number of labels


def fitted(skin: str, count: int, draw: int) -> PressReader:
    """A reader taught by a draw of labels."""
    presses, labels = few_labels.placed(skin)
    first, _ = split_rows(len(labels.touch), "time", 0)
    train = np.sort(np.random.default_rng(1000 + draw).choice(first, count, replace=False))
    return press_reader.fit(taken(presses, train), labels_of(labels, train), 0,
                            expectation_of(read_sensor(REAL / skin / "sensor.toml")))


def lost(skin: str, draw: int) -> dict[str, Mask]:
    """Masks of dead readings by what is dead."""
    pairs, rng = pd.read_csv(REAL / skin / "pairs.csv").to_numpy(), np.random.default_rng(draw)
    readings, electrodes = rng.permutation(len(pairs)), rng.permutation(np.unique(pairs))
    some = {name: np.isin(np.arange(len(pairs)), readings[:count])
            for name, count in (("none", 0), ("one", 1), ("five", 5), ("half", len(pairs) // 2))}
    return some | {name: np.isin(pairs, electrodes[:count]).any(axis=1)
                   for name, count in (("electrode", 1), ("two electrodes", 2))}


def tested(skin: str) -> tuple[Recording, Labels]:
    """The frames of the last fifth of the presses and their places."""
    recording, presses, _ = recorded(skin)
    _, labels = few_labels.placed(skin)
    _, test = split_rows(len(labels.touch), "time", 0)
    rows = recording.index >= presses.index[test[0]] - (recording.kind != "difference")
    return replace(recording, readings=recording.readings[rows], index=recording.index[rows],
                   touch=recording.touch[rows],
                   time_s=None if recording.time_s is None else recording.time_s[rows]), labels_of(labels, test)


def measured(reader: PressReader, recording: Recording, labels: Labels, dead: Mask) -> dict[str, float]:
    """What a reader does on frames that lack some readings."""
    model = PressModel(reader, recording.kind, 0, 0, 0, (), 0.0)
    table = model.predict(replace(recording, readings=np.where(dead, np.nan, recording.readings)), lambda _: None)
    value, low, high = (table[[f"{axis}0{end}_mm" for axis in "xy"]].to_numpy() for end in ("", "_lo90", "_hi90"))
    assert table["touch"].tolist() == labels.touch.tolist()
    right, verdict = labels.values, evaluate_predictions(table, recording, labels, "draw")["verdict"]
    inside = np.mean((low <= right) & (right <= high), axis=0)
    return {"readings": float(dead.sum()), "error_mm": distance(value, right), "said_mm": said_mm(reader, dead),
            "x_in_90": inside[0], "y_in_90": inside[1], "half_mm": float((high - low).mean() / 2),
            "flagged": float((table["flag"] != "").mean()), "holds": float(bool(verdict and verdict["holds"]))}


def said_mm(reader: PressReader, dead: Mask) -> float:
    """The mean distance that the model states."""
    moved = without_channels(reader, np.append(dead, dead[reader.signals.late]).tobytes()).mean[0]
    return float(np.hypot(reader.errors["place"], moved))


def rows_of(skin: str, count: int) -> pd.DataFrame:
    """The rows of a skin: means over draws, and the worst."""
    each = []
    for draw in range(DRAWS[count]):
        reader, (recording, labels) = fitted(skin, count, draw), tested(skin)
        each += [{"dead": name} | measured(reader, recording, labels, dead) for name, dead in lost(skin, draw).items()]
    table = pd.DataFrame(each)
    table["least"] = table[["x_in_90", "y_in_90"]].min(axis=1)
    groups = table.groupby("dead", sort=False)
    means = pd.DataFrame(groups.mean()).drop(columns="least")
    means["worst_mm"], means["least_in_90"] = groups["error_mm"].max(), groups["least"].min()
    return means.reset_index().assign(skin=skin, labels=count, draws=DRAWS[count])


def main(labels: Sequence[int]) -> None:
    if not REAL.is_dir():
        print(f"{REAL} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    done = {*zip(table["skin"], table["labels"], strict=True)} if len(table) else set()
    for count in labels:
        for skin in SKINS:
            if (skin, count) not in done:
                rows = rows_of(skin, count)
                shown(rows)
                table = written(pd.concat([table, rows], ignore_index=True), NAME)


if __name__ == "__main__":
    main([int(one) for one in sys.argv[1:]] or [*DRAWS])
