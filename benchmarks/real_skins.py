"""How well presses on real skins are read: error, coverage and CPU time, with kernel ridge and the mean.

Usage: python benchmarks/real_skins.py [labels ...]. Reads the recordings in ../shared/real, which others measured, and
stops where they are not there. Adds to results/real_skins.csv the rows that it lacks, one an output as each case is
done: `labels` 20, 100 and 0 (all). All labels are learnt, and an output that is not read has no row. The last fifth of
the presses in time tests (split time), or a fifth at random (split random); the labels are those just before in time
(taken last) or some at random (taken random). drift: how old the hydrogel's untouched frame is; "20 old": the frame of
20 presses before each press, "every 10": interpolated between untouched frames 10 presses apart; "read 5 old",
"read 20 old", "read first": training as recorded, and each tested press against the frame of 5 or 20 presses before, or
the first of all.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

from eitsim.sensors.labels import Labels, read_labels
from eitsim.sensors.recording import Recording, read_recording
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model.recorded.reader_scores import ReaderScore, read_rows, split_rows
from surrogate.recordings import press_reader
from surrogate.recordings.baselines import tracked
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.presses import Presses, labelled, presses_of
from touchcal.arrays import Index

REAL = Path(__file__).parents[1].parent / "shared" / "real"
NAME = "real_skins"
SKINS = quick(("skin_plain", "skin_radial", "skin_carbon", "hydrogel"), ("hydrogel",))
LABELS = quick((20, 100, 0), (20,))
# Untouched frames that are older where presses are read than where they trained -> how many presses older.
READ_OLD = {"read 5 old": 5, "read 20 old": 20, "read first": 10**6}
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
            for drift in READ_OLD:
                yield Case("hydrogel", count, "time", "last", drift)
                yield Case("hydrogel", count, "time", "random", drift)
                yield Case("hydrogel", count, "random", "random", drift)


def recorded(skin: str) -> tuple[Recording, Presses, Labels]:
    """The recording of a skin, its labelled presses and their labels."""
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


def read_old(recording: Recording, presses: Presses, rows: Index, count: int) -> Presses:
    """The presses, some rows against the untouched frame of so many presses before, or the first one."""
    touched = np.asarray(recording.readings, float)[recording.touch != ""]
    before = np.maximum(rows - count, 0)
    signal, following, age = presses.signal.copy(), presses.following.copy(), presses.age.copy()
    signal[rows], following[rows] = touched[rows] - presses.rest[before], np.nan
    age[rows] = presses.time[rows] - presses.rest_time[before]
    return replace(presses, signal=signal, following=following, age=age)


def rows_of(case: Case, count: int) -> tuple[Index, Index]:
    """Rows that train and rows that test."""
    train, test = split_rows(count, case.split, 0)
    if not case.labels:
        return train, test
    if case.taken == "last":
        return train[-case.labels:], test
    return np.sort(np.random.default_rng(0).permutation(train)[:case.labels]), test


def measured(case: Case) -> pd.DataFrame:
    """The rows of a case, one an output that is read."""
    recording, presses, labels = recorded(case.skin)
    train, test = rows_of(case, len(labels.touch))
    if case.drift in READ_OLD:
        presses = read_old(recording, presses, test, READ_OLD[case.drift])
    elif case.drift:
        presses = with_drift(recording, presses, case.drift)
    begun = time.process_time()
    expectation = expectation_of(read_sensor(REAL / case.skin / "sensor.toml"))
    read = read_rows(presses, labels, train, test, case.split, 0,
                     partial(press_reader.fit, expectation=expectation))
    spent = round(time.process_time() - begun, 1)
    return pd.DataFrame([asdict(case) | {
        "output": one.output, "unit": one.unit, "trained": one.trained, "tested": one.tested,
        "error": round(one.error, 4), "kernel_ridge": round(one.ridge_error, 4), "mean": round(one.mean_error, 4),
        **held(one), "cpu_s": spent} for one in (tested.score for tested in read)])


def held(one: ReaderScore) -> dict[str, float]:
    """Parts that the 90 % intervals and ellipses hold, and mean half widths of intervals: of x and y, or of a label."""
    axes = ("x", "y") if one.output == "place" else ("label",)
    return ({f"{axis}_in_90": round(part, 3) for axis, part in zip(axes, one.coverage, strict=True)}
            | {f"{axis}_half": round(half, 3) for axis, half in zip(axes, one.half_width, strict=True)}
            | ({} if one.in_ellipse is None else {"in_ellipse": round(one.in_ellipse, 3)}))


def main(labels: Sequence[int]) -> None:
    if not REAL.is_dir():
        print(f"{REAL} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    known = table[[*KEYS]].astype(object).fillna("").astype(str) if len(table) else pd.DataFrame(columns=[*KEYS])
    done = set(known.itertuples(index=False, name=None))
    for case in cases(labels):
        if tuple(str(getattr(case, key)) for key in KEYS) not in done:
            rows = measured(case)
            shown(rows)
            table = written(pd.concat([table, rows], ignore_index=True), NAME)


if __name__ == "__main__":
    main([int(one) for one in sys.argv[1:]] or LABELS)
