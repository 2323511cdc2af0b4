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
"""

import time
from collections.abc import Iterator
from functools import cache

import numpy as np
import pandas as pd
import real_skins
from conditions import earlier, quick, shown, written

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
from touchcal.arrays import Array

NAME = "another_session"
CARBON = ("skin_carbon_session1", "skin_carbon")
SHIFT_MM = {"skin_carbon": (46.1, -410.1)}  # of its coordinates from those of session 1
LABELS, FIVE, DRAWS = quick(200, 50), 5, quick(10, 2)
SYNTHETIC = ("synthetic", "synthetic, gains", "synthetic, gains and moved")
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
    done = {*zip(table["skin"], table["first"], strict=True)} if len(table) else set()
    for skin, first in cases():
        if (skin, first) not in done:
            rows = pd.DataFrame(measured(skin, first))
            shown(rows)
            table = written(pd.concat([table, rows], ignore_index=True), NAME)


if __name__ == "__main__":
    main()
