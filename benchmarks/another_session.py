"""How well a skin is read in another session: by the reader of the first session, and by that reader continued with
five labelled presses of the second.

Usage: python benchmarks/another_session.py. The carbon skin's two recordings in ../shared/real, which others measured,
are left out where they are not there; `first` is the session that trains. Synthetic skins, no skin measured, are drawn
by a seed a draw: gains of readings (logarithm normal, 0.3 each and 0.4 in common), the untouched frame (2 %), a turn
and a shift of the skin on the table. Labels are the last ones of the first four fifths of the first session; its last
fifth gives first_mm, the distance there. The five are drawn from the first four fifths of the second session, and its
last fifth tests. error_mm and the rest are means over `draws` of the five; worst_mm is the largest; x_in_90 and
y_in_90 are parts of the frames without a flag that the 90 % intervals hold, and half_mm the mean half width; moved:
part of the draws in which a motion of the skin was taken. Adds to results/another_session.csv the rows that it lacks.

"all labels, ..." are what the reader of the first session reaches on a recorded skin where all of the first four fifths
of the second session say what changed, in one of four ways (`mapped`): an affine map of the places read, a gain of each
reading, a linear map of signals, and that with an affine map of places. `first_mm` of the other direction is what as
many labels of the second session itself teach. They show what such changes are worth, and are no bound of all readers.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import real_skins
from conditions import earlier, quick, shown, written
from scipy.spatial import KDTree

from eitsim.sensors.labels import PLACE, Labels, labels_of, places_of
from eitsim.sensors.sensor_file import read_sensor
from surrogate.data.sensor_ring import ring_of_design
from surrogate.forward_map.multipole_series import electrode_fields
from surrogate.model.recorded.continued import continued
from surrogate.model.recorded.reader_scores import split_rows
from surrogate.recordings import press_reader
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.presses import Presses, taken
from surrogate.recordings.session.motion import Motion
from surrogate.recordings.worth import distance
from touchcal.arrays import Array, Mask

NAME = "another_session"
CARBON = ("skin_carbon_session1", "skin_carbon")
SHIFT_MM = {"skin_carbon": (46.1, -410.1)}  # of its coordinates from those of session 1
LABELS, FIVE, DRAWS = quick(200, 50), 5, quick(10, 2)
SYNTHETIC = ("synthetic", "synthetic, gains", "synthetic, gains and moved")
NEAREST, PENALTIES = 5, np.geomspace(1e-6, 1e3, 19)  # presses of the first session, and of linear maps of signals
RADIUS_MM, WITHIN_MM, PRESSES, NOISE = 100.0, 60.0, 400, 0.3
Session = tuple[Presses, Labels]


def carbon(skin: str) -> Session:
    """The presses of a session and their places in the coordinates of session 1."""
    _, presses, labels = real_skins.recorded(skin)
    return presses, Labels(labels.touch, PLACE, places_of(labels) - SHIFT_MM.get(skin, (0.0, 0.0)))


def synthetic(skin: str, seed: int, first: bool) -> Session:
    """Presses of first-order signals, an untouched frame before each; but for the first session, changed."""
    rng, ring = np.random.default_rng(seed), ring_of_design({})
    radius, angle = WITHIN_MM * np.sqrt(rng.random(PRESSES)), 2 * np.pi * rng.random(PRESSES)
    place = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    fields = electrode_fields(ring, ring.modes, (place[:, 0] + 1j * place[:, 1]) / RADIUS_MM, 1)[0]
    product = (fields[:, ring.source] - fields[:, ring.sink]) * (fields[:, ring.read] - fields[:, ring.ground]).conj()
    signal = rng.uniform(0.7, 1.3, PRESSES)[:, None] * product.real
    size = np.abs(signal).mean()
    rest = 6 * size * (1 + 0.5 * np.random.default_rng(5).random(signal.shape[1]))
    signal += NOISE * size * rng.standard_normal(signal.shape)
    if not first and "gains" in skin:
        gain = np.exp(0.3 * rng.standard_normal(len(rest)) + 0.4 * rng.standard_normal())
        signal, rest = gain * signal, gain * rest * (1 + 0.02 * rng.standard_normal(len(rest)))
    if not first and "moved" in skin:
        place = Motion(np.zeros(2), rng.uniform(-np.pi, np.pi), rng.uniform(-60, 60, 2)).of(place)
    time_of, names = np.arange(1.0, 2 * PRESSES, 2), np.arange(PRESSES).astype(np.str_)
    frames = rest + 0.01 * size * rng.standard_normal(signal.shape)
    return (Presses(names, time_of.astype(np.int64), signal, np.full_like(signal, np.nan), np.ones(PRESSES), frames,
                    time_of - 1, time_of), Labels(names, PLACE, place))


def cases() -> Iterator[tuple[str, str]]:
    """Skins and their first sessions."""
    if real_skins.REAL.is_dir():
        yield "carbon", CARBON[0]
        yield "carbon", CARBON[1]
    for skin in SYNTHETIC:
        yield skin, "drawn"


@cache
def taught(first: str) -> tuple[press_reader.PressReader, float]:
    """A reader of a first session, and its distance on the last fifth of it, mm."""
    real = first in CARBON
    presses, labels = carbon(first) if real else synthetic("", 1, True)
    early, last = split_rows(len(labels.touch), "time", 0)
    rows = early[-LABELS:]
    expectation = expectation_of(read_sensor(real_skins.REAL / first / "sensor.toml")) if real else None
    reader = press_reader.fit(taken(presses, rows), labels_of(labels, rows), 0, expectation)
    return reader, read(reader, taken(presses, last), labels.values[last])["error_mm"]


def measured(skin: str, first: str) -> list[dict[str, object]]:
    """The rows of a skin: the first reader alone, and continued."""
    reader, first_mm = taught(first)
    each: list[dict[str, float]] = []
    before: list[dict[str, float]] = []
    for draw in range(DRAWS):
        other, right = (carbon(next(one for one in CARBON if one != first)) if first in CARBON else
                        synthetic(skin, 100 + draw, False))
        early, last = split_rows(len(right.touch), "time", 0)
        five = np.sort(np.random.default_rng(draw).choice(early, FIVE, replace=False))
        begun = time.process_time()
        made = continued(reader, taken(other, five), labels_of(right, five))
        spent, test = time.process_time() - begun, (taken(other, last), right.values[last])
        each.append(read(made.reader, *test) | {"cpu_s": spent, "moved": float(made.reader.motion is not None)})
        before.append(read(reader, *test))
    key = {"skin": skin, "first": first, "labels": LABELS, "draws": DRAWS, "first_mm": first_mm}
    return [key | {"reader": name, "five": five, "worst_mm": max(one["error_mm"] for one in found)}
            | pd.DataFrame(found).mean().to_dict() for name, five, found in
            (("of the first session", 0, before), ("continued", FIVE, each))]


def mapped(first: str) -> list[dict[str, object]]:
    """The rows of the first reader with maps of places or of signals that all early labels of the second session give,
    signals being mapped to the mean of the nearest presses of the first session."""
    (reader, first_mm), (before, was_at) = taught(first), carbon(first)
    presses, labels = carbon(next(one for one in CARBON if one != first))
    early, last = split_rows(len(labels.touch), "time", 0)
    place = labels.values
    near = np.asarray(KDTree(was_at.values).query(place[early], NEAREST)[1])
    signal, expected = presses.signal, before.signal[near].mean(axis=1)
    gain = np.sum(signal[early] * expected, axis=0) / np.sum(signal[early] ** 2, axis=0)
    of_signals = signal * gain + signal @ linear_map(signal[early], expected - signal[early] * gain)
    ways = {"affine map of places": (signal, True), "gains": (signal * gain, False),
            "linear map of signals": (of_signals, False), "linear map of signals, affine map of places":
            (of_signals, True)}
    rows: list[dict[str, object]] = []
    for name, (given, affine) in ways.items():
        found = press_reader.read(reader, replace(presses, signal=given)).place
        assert found
        one = np.column_stack([found.value, np.ones(len(place))])
        value = one @ np.linalg.lstsq(one[early], place[early])[0] if affine else found.value
        rows.append({"skin": "carbon", "first": first, "labels": LABELS, "first_mm": first_mm, "five": len(early),
                     "reader": f"all labels, {name}", "error_mm": distance(value[last], place[last])})
    return rows


def linear_map(signal: Array, left: Array) -> Array:
    """(m, m) the map of signals (n, m) to (n, m), drawn to 0 as every fifth press, held out, would have it."""
    held: Mask = np.arange(len(signal)) % 5 == 0

    def fitted(rows: Mask, penalty: float) -> Array:
        square = signal[rows].T @ signal[rows]
        return np.linalg.solve(square + penalty * np.trace(square) / len(square) * np.eye(len(square)),
                               signal[rows].T @ left[rows])

    missed = [np.sum((left - signal @ fitted(~held, penalty))[held] ** 2) for penalty in PENALTIES]
    return fitted(held | ~held, PENALTIES[int(np.argmin(missed))])


def read(reader: press_reader.PressReader, presses: Presses, place: Array) -> dict[str, float]:
    """What a reader does on presses at places (n, 2), mm; coverage of frames without a flag."""
    found = press_reader.read(reader, presses)
    assert found.place
    inside = np.abs(found.place.value - place) <= found.place.bounds.half_width
    x, y = inside[found.kinds == 0].mean(axis=0) if (found.kinds == 0).any() else (np.nan, np.nan)
    return {"error_mm": distance(found.place.value, place), "x_in_90": float(x), "y_in_90": float(y),
            "half_mm": float(found.place.bounds.half_width.mean()), "flagged": float(np.mean(found.kinds > 0))}


def main() -> None:
    table = earlier(NAME)
    of_all = table["reader"].str.startswith("all labels") if len(table) else np.zeros(0, bool)
    done, known = ({*zip(some["skin"], some["first"], strict=True)} if len(some) else set()
                   for some in (table[~of_all], table[of_all]))
    for skin, first in cases():
        asked = [measured(skin, first)] if (skin, first) not in done else []
        asked += [mapped(first)] if first in CARBON and (skin, first) not in known else []
        for rows in map(pd.DataFrame, asked):
            shown(rows)
            table = written(pd.concat([table, rows], ignore_index=True), NAME)


if __name__ == "__main__":
    main()
