"""How much 20 presses teach where `surrogate train --suggest` names their places, and 20 and 30 at random.

Usage: python benchmarks/suggest.py. Reads the recordings in ../shared/real, which others measured, and stops where they
are not there. Adds to results/suggest.csv the rows that it lacks, one as each is done.

The last fifth of the presses in time tests. A suggested place is "pressed" by taking the nearest recorded press of the
rest that is not taken yet; places are in coordinates about the middle of their range, which a user knows. Ways:
random; suggested, as the command does; nearest (the mean squared distance to the nearest press is made least,
greedily); gradient (as suggested, the variance weighted by the squared place error that it makes, by the sensitivity of
a uniform disc); error (likewise, by held-out errors of the first presses). `first`: how many of the presses are taken
at random before any is suggested; with none the design is turned by a random angle in each repeat. `reader`: the
templates of direction alone, or all families. error_mm is the mean over `repeats`, se_mm its standard error.
"""

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import product

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from real_skins import REAL, recorded

from eitsim.sensors.labels import PLACE, Labels, places_of
from eitsim.sensors.sensor_file import Sensor, read_sensor
from surrogate.model.recorded.reader_scores import split_rows
from surrogate.recordings import press_reader, templates
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.disc_grid import disc_grid
from surrogate.recordings.physics.expectation import Pose, expectation_of
from surrogate.recordings.presses import Presses, taken, until
from surrogate.recordings.suggestion.next_presses import ACROSS, SHARE, greedy, left_open, next_presses
from surrogate.statistics.gaussian_process import squared_distance
from touchcal.arrays import Array, Index

NAME = "suggest"
CHOSEN_ON, CHECKED_ON = quick((("hydrogel", "skin_plain"), ("skin_radial", "skin_carbon")), (("hydrogel",), ()))
KEYS = ("skin", "reader", "way", "first", "presses")
REPEATS = {"templates": quick(20, 2), "all": quick(10, 1)}
CLOSE = 0.2  # of the radius: length over which held-out errors are averaged


@dataclass(frozen=True)
class Case:
    """One row of the table, before it is measured."""

    skin: str
    reader: str  # templates or all
    way: str
    first: int  # presses taken at random
    presses: int


@dataclass(frozen=True, eq=False)
class Skin:
    """A recording, its places about their middle."""

    presses: Presses
    place: Array  # (n, 2) mm
    sensor: Sensor

    @property
    def radius(self) -> float:
        """Of its body, mm."""
        return self.sensor.body.radius_m * 1e3


def cases() -> Iterator[Case]:
    """The rows of the table in the order in which they are measured."""
    asked = (("random", 0, 20), ("random", 0, 30), ("suggested", 0, 20))
    for skin, one in product((*CHOSEN_ON, *CHECKED_ON), asked):
        yield Case(skin, "templates", *one)
    for way, first, skin in product(("gradient", "nearest", "suggested", "error"), (0, 10), CHOSEN_ON):
        if first or way in ("gradient", "nearest"):
            yield Case(skin, "templates", way, first, 20)
    for skin, one in product(CHOSEN_ON, asked):
        yield Case(skin, "all", *one)


def skin_of(name: str) -> Skin:
    """The recording of a skin."""
    _, presses, labels = recorded(name)
    place = places_of(labels)
    return Skin(presses, place - (place.min(axis=0) + place.max(axis=0)) / 2, read_sensor(REAL / name / "sensor.toml"))


def rows_taken(skin: Skin, case: Case, train: Index, rng: np.random.Generator) -> Index:
    """Rows that are pressed, in time order."""
    if case.way == "random":
        return np.sort(rng.permutation(train)[:case.presses])
    rows = list(rng.permutation(train)[:case.first])
    asked = places_asked(skin, case, np.array(rows, np.intp))
    turn = 0.0 if rows else rng.uniform(0, 2 * np.pi)
    for place in asked @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]):
        free = np.setdiff1d(train, rows)
        rows.append(free[np.linalg.norm(skin.place[free] - place, axis=1).argmin()])
    return np.sort(rows)


def places_asked(skin: Skin, case: Case, rows: Index) -> Array:
    """Places (count, 2), mm, that a way suggests after some rows."""
    count, pressed = case.presses - len(rows), skin.place[rows]
    if case.way == "suggested":
        return next_presses(skin.radius, pressed, count).place
    grid = disc_grid(np.zeros(2), SHARE * skin.radius, ACROSS)
    if case.way == "nearest":
        return nearest(grid, pressed, count)
    left = left_open(grid, pressed, skin.radius)
    weight = by_gradient(skin, grid) if case.way == "gradient" else by_error(skin, grid, rows)
    return grid[greedy(left, weight / weight.sum(), count)[0]]


def nearest(grid: Array, pressed: Array, count: int) -> Array:
    """Places of the grid (g, 2) that lower the mean squared distance to the nearest press most, one after another."""
    between = squared_distance(grid, grid)
    far = squared_distance(grid, pressed).min(axis=1) if len(pressed) else np.full(len(grid), between.max())
    chosen = []
    for _ in range(count):
        chosen.append(int(np.maximum(far[:, None] - between, 0).sum(axis=0).argmax()))
        far = np.minimum(far, between[:, chosen[-1]])
    return grid[chosen]


def by_gradient(skin: Skin, grid: Array) -> Array:
    """(g,) squared place error that equal errors of all readings make, by the sensitivity of a uniform disc."""
    expected, step = expectation_of(skin.sensor), 0.01 * skin.radius
    pose = Pose(0j, skin.radius, 0.0, mirrored=False)
    slope = [(expected.patterns(pose, grid + by) - expected.patterns(pose, grid - by)) / (2 * step)
             for by in step * np.eye(2)]
    xx, xy, yy = (np.sum(slope[i] * slope[k], axis=1) for i, k in ((0, 0), (0, 1), (1, 1)))
    return (xx + yy) / (xx * yy - xy**2)


def by_error(skin: Skin, grid: Array, rows: Index) -> Array:
    """(g,) mean square of the held-out errors of the rows close to each place."""
    fitted = templates.fit(skin.presses.signal[rows], skin.place[rows], time_blocks(len(rows)), compress=False)
    square = np.sum((fitted.place - skin.place[rows])**2, axis=1)
    close = np.exp(-squared_distance(grid, skin.place[rows]) / (2 * (CLOSE * skin.radius)**2)) + 1e-3
    return close @ square / close.sum(axis=1)


def error_of(skin: Skin, reader: str, rows: Index, test: Index) -> float:
    """Mean distance, mm, of tested places read by what some rows teach."""
    expected = expectation_of(skin.sensor)
    if reader == "templates":
        fitted = templates.fit(skin.presses.signal[rows], skin.place[rows], time_blocks(len(rows)), compress=False,
                               priors=(templates.nothing, expected.learn))
        value = fitted.templates.read(skin.presses.signal[test])[0]
    else:
        labels = Labels(skin.presses.name[rows], PLACE, skin.place[rows])
        known = until(taken(skin.presses, rows), float(skin.presses.time[rows].max()))
        fitted_reader = press_reader.fit(known, labels, 0, expected)
        found = press_reader.read(fitted_reader, taken(skin.presses, test)).place
        value = found.value if found else np.broadcast_to(skin.place[rows].mean(axis=0), (len(test), 2))
    return float(np.linalg.norm(value - skin.place[test], axis=1).mean())


def measured(case: Case) -> dict[str, object]:
    """The row of a case."""
    skin = skin_of(case.skin)
    train, test = split_rows(len(skin.place), "time", 0)
    begun = time.process_time()
    errors = np.array([error_of(skin, case.reader, rows_taken(skin, case, train, np.random.default_rng(repeat)), test)
                       for repeat in range(REPEATS[case.reader])])
    return asdict(case) | {"repeats": len(errors), "error_mm": round(float(errors.mean()), 3),
                           "se_mm": round(float(errors.std(ddof=1) / np.sqrt(len(errors))), 3) if len(errors) > 1
                           else np.nan, "cpu_s": round((time.process_time() - begun) / len(errors), 2)}


def main() -> None:
    if not REAL.is_dir():
        print(f"{REAL} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    done = set(table[[*KEYS]].astype(str).itertuples(index=False, name=None)) if len(table) else set()
    for case in cases():
        if tuple(str(getattr(case, key)) for key in KEYS) not in done:
            row = pd.DataFrame([measured(case)])
            shown(row)
            table = written(pd.concat([table, row], ignore_index=True), NAME)


if __name__ == "__main__":
    main()
