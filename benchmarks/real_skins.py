"""How well presses on real skins are read: place error, coverage and CPU time, with kernel ridge and the mean place.

Usage: python benchmarks/real_skins.py [labels ...]. Reads the recordings in ../shared/real, which others measured, and
stops where they are not there. Adds to results/real_skins.csv the rows that it lacks, one as each is done: `labels` 20,
100 and 0 (all). The last fifth of the presses in time tests (split time), or a fifth at random (split random); the
labels are those just before in time (taken last) or some at random (taken random). drift: how old the hydrogel's
untouched frame is; "20 old": the frame of 20 presses before each press, "every 10": interpolated between untouched
frames 10 presses apart.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

from eitsim.sensors.labels import read_labels
from eitsim.sensors.recording import Recording, read_recording
from eitsim.sensors.sensor_file import read_sensor
from surrogate.recordings.baselines import tracked
from surrogate.recordings.presses import Presses, labelled, presses_of
from surrogate.recordings.reader_scores import scored, split_rows
from touchcal.arrays import Array, Index

REAL = Path(__file__).parents[1].parent / "shared" / "real"
NAME = "real_skins"
SKINS = quick(("skin_plain", "skin_radial", "skin_carbon", "hydrogel"), ("hydrogel",))
LABELS = quick((20, 100, 0), (20,))
KEYS = ("skin", "labels", "split", "taken", "drift")


@dataclass(frozen=True)
class Case:
    """One row of the table, before it is measured."""

    skin: str
    labels: int  # 0: all of the training part
    split: str  # time or random
    taken: str  # last or random
    drift: str = ""  # how the untouched frame is known; empty: as recorded


def cases(labels: Sequence[int]) -> Iterator[Case]:
    """The rows of the table in the order in which they are measured."""
    for count in labels:
        for skin in SKINS:
            yield Case(skin, count, "time", "last")
            if count:
                yield Case(skin, count, "time", "random")
            yield Case(skin, count, "random", "random")
        if count == 100:
            for drift in ("20 old", "every 10"):
                yield Case("hydrogel", count, "time", "last", drift)
                yield Case("hydrogel", count, "time", "random", drift)


def recorded(skin: str) -> tuple[Recording, Presses, Array]:
    """The recording of a skin, its labelled presses and their places, mm."""
    folder = REAL / skin
    recording = read_recording(folder / "frames.csv", kind=read_sensor(folder / "sensor.toml").kind)
    return recording, *labelled(presses_of(recording), read_labels(folder / "touches.csv"), skin)


def with_drift(recording: Recording, presses: Presses, drift: str) -> Presses:
    """The presses against an untouched frame that is known less well; recorded is one just before each press."""
    touched = np.asarray(recording.readings, float)[recording.touch != ""]
    time_of = np.arange(1.0, 2 * len(touched) + 1, 2)
    if drift == "20 old":
        before = np.maximum(np.arange(len(touched)) - 20, 0)
        rest, age, kept = presses.rest[before], time_of - 2.0 * before, slice(None, None, 20)
    else:
        kept = slice(None, None, 10)
        known = presses.rest_time[kept]
        all_time = np.asarray(np.append(known, time_of), np.float64)
        order = np.argsort(all_time, kind="stable")
        frames = np.concatenate([presses.rest[kept], touched])
        untouched = np.arange(len(frames)) < len(known)
        rest, age = tracked(frames[order], all_time[order], untouched[order])
    return replace(presses, signal=touched - rest, following=np.full_like(rest, np.nan), age=age,
                   rest=presses.rest[kept], rest_time=presses.rest_time[kept])


def rows_of(case: Case, count: int) -> tuple[Index, Index]:
    """Rows that train and rows that test."""
    train, test = split_rows(count, case.split, 0)
    if not case.labels:
        return train, test
    if case.taken == "last":
        return train[-case.labels:], test
    return np.sort(np.random.default_rng(0).permutation(train)[:case.labels]), test


def measured(case: Case) -> dict[str, object]:
    """The row of a case."""
    recording, presses, place = recorded(case.skin)
    if case.drift:
        presses = with_drift(recording, presses, case.drift)
    train, test = rows_of(case, len(place))
    known = presses
    if len(presses.rest):
        before = presses.rest_time <= presses.index[train].max()
        known = replace(presses, rest=presses.rest[before], rest_time=presses.rest_time[before])
    begun = time.process_time()
    found = scored(known, place, train, test, case.split, 0)
    return asdict(case) | {
        "trained": found.trained, "tested": found.tested, "distance_mm": round(found.distance_mm, 3),
        "kernel_ridge_mm": round(found.ridge_mm, 3), "mean_place_mm": round(found.centre_mm, 2),
        "x_in_90": round(found.coverage[0], 3), "y_in_90": round(found.coverage[1], 3),
        "x_half_mm": round(found.width_mm[0], 2), "y_half_mm": round(found.width_mm[1], 2),
        "cpu_s": round(time.process_time() - begun, 1)}


def main(labels: Sequence[int]) -> None:
    if not REAL.is_dir():
        print(f"{REAL} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    known = table[[*KEYS]].astype(object).fillna("").astype(str) if len(table) else pd.DataFrame(columns=[*KEYS])
    done = set(known.itertuples(index=False, name=None))
    for case in cases(labels):
        if tuple(str(getattr(case, key)) for key in KEYS) not in done:
            row = pd.DataFrame([measured(case)])
            shown(row)
            table = written(pd.concat([table, row], ignore_index=True), NAME)


if __name__ == "__main__":
    main([int(one) for one in sys.argv[1:]] or LABELS)
