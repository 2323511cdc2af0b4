"""How well few labelled presses teach: ours, with the sensor file and without it ("no sensor": no prior from physics),
next to kernel ridge regression, linear ridge and a Gaussian process.

Usage: python benchmarks/few_labels.py [labels ...] [methods ...]. Reads the recordings in ../shared/real, which others
measured, and stops where they are not there. Adds to results/few_labels.csv the rows that it lacks, one a skin, number
of labels and method as each is done. Labels are presses drawn at random from the first four fifths in time; the last
fifth tests. error_mm is the mean over `draws` of the mean distance, worst_mm the largest; x_in_90 and y_in_90 the mean
part of the tested presses that the 90 % intervals hold, least_in_90 the least of both in any draw (kernel ridge has
none); flagged the part of the tested presses with a flag. Draws that a method refuses, since held-out presses are read
no better than by their mean, are counted in `refused` and in nothing else. "further draws" are as many others, read as
by "families", on which nothing was chosen: draws differ more than skins do. Intervals that were exactly right for
normal errors of ten presses, by Student's t with nine degrees of freedom, would hold 63 % in the worst of 40 draws (51
to 72 % in eight of ten such sets), and 75 % or more in all 40 in one set of 27 (`exact_worst`).
"""

import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from real_skins import REAL, SKINS, recorded
from scipy.special import ndtr, stdtrit

from eitsim.sensors.labels import PLACE, Labels, labels_of, places_of
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model.recorded import plain_reader
from surrogate.model.recorded.reader_scores import split_rows
from surrogate.recordings import press_reader
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.presses import Presses, taken
from surrogate.recordings.worth import NothingToRead, distance
from touchcal.arrays import Array

NAME = "few_labels"
LABELS = quick((10, 20, 50), (20,))
FURTHER = "further draws"
METHODS = quick(("families", FURTHER, "no sensor", "ridge", "gp"), ("families", "no sensor"))
DRAWS = quick(10, 1)


@dataclass(frozen=True)
class Case:
    """One draw of labels."""

    skin: str
    labels: int
    draw: int
    method: str = "families"


@cache
def placed(skin: str) -> tuple[Presses, Labels]:
    """The labelled presses of a skin and their places alone."""
    _, presses, labels = recorded(skin)
    return presses, Labels(labels.touch, PLACE, places_of(labels))


def measured(case: Case) -> dict[str, float]:
    """What a reader taught by a draw does on the last fifth of the presses."""
    presses, labels = placed(case.skin)
    first, test = split_rows(len(labels.touch), "time", 0)
    train = np.sort(np.random.default_rng(1000 + case.draw).choice(first, case.labels, replace=False))
    begun = time.process_time()
    by_families = partial(press_reader.fit, expectation=expectation_of(read_sensor(REAL / case.skin / "sensor.toml")))
    fit = {"families": by_families, FURTHER: by_families, "no sensor": press_reader.fit}.get(
        case.method) or partial(plain_reader.fit, case.method)
    reader, tested, right = fit(taken(presses, train), labels_of(labels, train), 0), taken(presses, test), labels.values
    found = press_reader.read(reader, tested)
    assert found.place
    inside = np.abs(found.place.value - right[test]) <= found.place.bounds.half_width
    return {"error_mm": distance(found.place.value, right[test]),
            "kernel_ridge_mm": distance(reader.yardstick("place", tested), right[test]),
            "x_in_90": float(inside[:, 0].mean()), "y_in_90": float(inside[:, 1].mean()),
            "half_mm": float(found.place.bounds.half_width.mean()), "flagged": float((found.kinds > 0).mean()),
            "cpu_s": time.process_time() - begun}


def exact_worst(sets: int, seed: int, presses: int = 10) -> Array:
    """(sets,) least part that intervals of x or y hold in any of 40 draws, ten on each skin, where errors are normal
    and all that is known of their size are as many independent ones as presses."""
    rng = np.random.default_rng(seed)
    tested = np.repeat([400, 400, 400, 70], 10)[:, None]
    size = np.sqrt(rng.chisquare(presses - 1, (sets, 40, 1)) / (presses - 1))
    held = 2 * ndtr(stdtrit(presses - 1, 0.95) * size) - 1
    return (rng.binomial(tested, np.broadcast_to(held, (sets, 40, 2))) / tested).min(axis=(1, 2))


def rows(skin: str, labels: int, method: str) -> list[dict[str, object]]:
    """The rows of a method, and that of kernel ridge regression next to the families."""
    each = []
    first = DRAWS if method == FURTHER else 0
    for draw in range(first, first + DRAWS):
        with suppress(NothingToRead):
            each.append(measured(Case(skin, labels, draw, method)))
    table = pd.DataFrame(each)
    mean = table.mean()
    key = {"skin": skin, "labels": labels, "draws": DRAWS, "refused": DRAWS - len(each)}
    means = {name: mean[name] for name in ("error_mm", "x_in_90", "y_in_90", "half_mm", "flagged", "cpu_s")}
    out: list[dict[str, object]] = [key | {"method": method, "worst_mm": table["error_mm"].max()} | means
                                    | {"least_in_90": table[["x_in_90", "y_in_90"]].min(axis=None)}]
    if method == "families":
        out.append(key | {"method": "kernel ridge", "error_mm": mean["kernel_ridge_mm"],
                          "worst_mm": table["kernel_ridge_mm"].max()})
    return out


def main(labels: Sequence[int], methods: Sequence[str]) -> None:
    if not REAL.is_dir():
        print(f"{REAL} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    done = {*zip(table["skin"], table["labels"], table["method"], strict=True)} if len(table) else set()
    for count in labels:
        for skin in SKINS:
            for method in methods:
                if (skin, count, method) not in done:
                    one = pd.DataFrame(rows(skin, count, method))
                    shown(one)
                    table = written(pd.concat([table, one], ignore_index=True), NAME)


if __name__ == "__main__":
    asked = sys.argv[1:]
    main([int(one) for one in asked if one.isdigit()] or LABELS, [one for one in asked if not one.isdigit()] or METHODS)
