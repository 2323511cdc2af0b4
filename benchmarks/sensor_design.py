"""What a choice of readings costs: bounds over the disc, models retrained on it, presses on real skins.

Usage: python benchmarks/sensor_design.py CARD SWEEP [part ...]. SWEEP is of examples/design.toml with CARD and some
1,000 scenes. Replaces the rows of these parts, all where none is named, in results/sensor_design.csv. All ratios are to
all readings of the own drive, at the same white noise in every reading (80 dB below the RMS of the own drive's
untouched ones).

part "bounds": medians of the least standard deviations over the whole disc of x, y, F of a punch of known diameter, of
readings chosen from the own drive or from any four electrodes; least: below this no choice of as many readings of the
own drive has its mean variance over places, each over that of all readings, by the relaxation to weights from 0 to 1
(its root, the mean of x, y and F).
part "drives": these medians by drive, over the own drive's and in mm and N; over_own is the geometric mean of ratios
over places and unknowns.
part "retrained": root mean square errors of x0, y0, F of the method forward on unseen rows, trained on the chosen
readings alone; bound: the ratio of the medians over the sweep's part of the disc, its diameters unknown.
part "skins": mean distance of kernel ridge regression, trained on the first presses and tested on the last fifth in
time, of 48 of 192 readings. "physics": chosen by the bounds of the sensor file's disc with CARD, which is not the
skins' material, and without labels; "chance": the mean of two choices by chance. part "presses": the same, chosen by
the training presses, the last 300 at most, so that they explain waves of the place best by stepwise regression, in the
way that reads blocks best which are held out of choice and training. Both read ../shared/real, measured by others, and
are left out where it is not there.
"""

import itertools
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from real_skins import REAL, SKINS, Case, recorded, rows_of

import surrogate
from eitsim.scene.scene import Scene
from eitsim.sensors.layout.reading_choice import bounds, chosen
from eitsim.sensors.layout.sensor_design import OWN, candidate_pairs, design_sensor, spread_before
from eitsim.sensors.layout.touch_slopes import TouchSlopes, reading_slopes, touch_slopes, untouched_V
from eitsim.sensors.sensor_file import Sensor, pairs_of, read_sensor
from matcal.card import MaterialCard, read_card
from surrogate.data.samples import SweepSamples, read_samples, split, take
from surrogate.recordings import kernel_ridge
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.patterns import compressed, compression_scale, direction
from surrogate.recordings.place_networks import EACH, draw_waves
from touchcal.arrays import Array, Index

PARTS = ("bounds", "drives", "retrained", "skins", "presses")
NOISE_DB, KEPT = 80.0, quick((24, 32, 48, 64, 72, 96, 128), (32,))
RETRAINED, WITHIN_M = quick((32, 72), (32,)), 0.045
ON_SKINS, LABELS = 48, quick((100, 0), (100,))
MOST = 300  # training presses, the last ones, that readings are chosen by
RIDGE = 0.1  # of a reading's variance, added in stepwise regression


def over_noise(slopes: TouchSlopes, own: Index, pairs: Index, unknowns: int) -> Array:
    """(places, readings, unknowns) derivatives of readings over the noise, which follows from the own drive's."""
    noise_V = np.sqrt(np.mean(untouched_V(slopes, own) ** 2)) * 10 ** (-NOISE_DB / 20)
    return reading_slopes(slopes, pairs)[..., :unknowns] / noise_V


def own_pairs(scene: Scene) -> Index:
    """The readings of a scene's own drive."""
    return pairs_of(Sensor(scene.body, scene.skin, scene.electrodes, scene.drive))


def least(by: Array, count: int) -> float:
    """Root of the least mean, over places and unknowns, of variances over those of all readings, for weights of the
    readings from 0 to 1 whose sum is count (multiplicative updates of a convex criterion)."""
    whole = bounds(by) ** 2
    weight = np.full(by.shape[1], count / by.shape[1])

    def covariance() -> Array:
        return np.linalg.inv(np.einsum("r,nrp,nrq->npq", weight, by, by, optimize=True))

    for _ in range(quick(200, 10)):
        gain = weight * np.sqrt(np.einsum("nrp,np->r", (by @ covariance()) ** 2, 1 / whole))
        low, high = 0.0, 1e9 / gain.max()
        for _ in range(80):
            middle = (low + high) / 2
            low, high = (low, middle) if np.minimum(1, gain * middle).sum() > count else (middle, high)
        weight = np.minimum(1, gain * low)
    return float(np.sqrt(np.mean(np.einsum("npp->np", covariance()) / whole)))


def bound_rows(slopes: TouchSlopes, scene: Scene) -> Iterator[dict[str, object]]:
    """Bounds of choices from the own drive and from any four electrodes, and by chance."""
    own, rng = own_pairs(scene), np.random.default_rng(0)
    own_by = over_noise(slopes, own, own, 3)
    whole, before = bounds(own_by), spread_before(slopes, scene)[:3]
    for what in ("own", "all"):
        by = over_noise(slopes, own, candidate_pairs(own, scene.electrodes.count, what), 3)
        order = chosen(by, max(KEPT), before)
        for count in KEPT:
            yield rated(what, by[:, order[:count]], whole) | (
                {"least": least(own_by, count)} if what == "own" else {})
    for count in KEPT:
        yield rated("chance", own_by[:, rng.permutation(len(own))[:count]], whole)


def drive_rows(scene: Scene, card: MaterialCard) -> Iterator[dict[str, object]]:
    """Bounds by drive."""
    drives = design_sensor(scene, card, noise_dB=NOISE_DB).drives
    own = next(drive.median for drive in drives if drive.name == OWN)
    for drive in drives:
        yield {"part": "drives", "what": drive.name, "readings": drive.readings, "over_own": drive.over_own} | dict(
            zip(("x", "y", "F", "x_mm", "y_mm", "F_N"), [*(drive.median / own), *drive.median], strict=True))


def rated(what: str, by: Array, whole: Array) -> dict[str, object]:
    """Ratios of the medians of bounds to those of all readings, and of their 90 % quantiles."""
    sd = bounds(by)
    return {"part": "bounds", "what": what, "readings": by.shape[1]} | {
        name: np.median(sd[:, k]) / np.median(whole[:, k]) for k, name in enumerate("xyF")} | {
        f"high_{name}": np.quantile(sd[:, k], 0.9) / np.quantile(whole[:, k], 0.9) for k, name in enumerate("xyF")}


def retrained_rows(slopes: TouchSlopes, scene: Scene, sweep: SweepSamples) -> Iterator[dict[str, object]]:
    """Errors of models trained on chosen readings and on readings by chance, the first with all."""
    own, rng = own_pairs(scene), np.random.default_rng(0)
    by = over_noise(slopes, own, own, 4)
    order, whole = chosen(by, max(RETRAINED), spread_before(slopes, scene)), np.median(bounds(by), axis=0)
    noise_V = np.sqrt(np.mean(sweep.baseline_V**2)) * 10 ** (-NOISE_DB / 20)
    all_error = errors(sweep, noise_V)
    yield {"part": "retrained", "what": "all", "readings": len(own)} | all_error
    for what, count, kept in (*(("own", count, np.sort(order[:count])) for count in RETRAINED),
                              ("chance", RETRAINED[0], np.sort(rng.permutation(len(own))[:RETRAINED[0]]))):
        found = errors(of_readings(sweep, kept), noise_V)
        bound = np.median(bounds(by[:, kept]), axis=0) / whole
        yield {"part": "retrained", "what": what, "readings": count} | found | {
            name: found[f"{name}_{unit}"] / all_error[f"{name}_{unit}"] for name, unit in (
                ("x", "mm"), ("y", "mm"), ("F", "N"))} | {f"bound_{n}": b for n, b in zip("xyF", bound, strict=False)}


def of_readings(sweep: SweepSamples, kept: Index) -> SweepSamples:
    """SweepSamples of some readings alone."""
    ring = replace(sweep.ring, **{name: getattr(sweep.ring, name)[kept] for name in ("source", "sink", "read",
                                                                                      "ground")})
    return replace(sweep, ring=ring, signal_V=sweep.signal_V[:, kept], baseline_V=sweep.baseline_V[:, kept])


def errors(sweep: SweepSamples, noise_V: float) -> dict[str, float]:
    """Root mean square errors on rows that were not seen, with noise."""
    model = surrogate.train(sweep, outputs="x0,y0,F", seed=0)
    test = take(sweep, split(sweep.group, 0) == "test")
    noisy = test.signal_V + noise_V * np.random.default_rng(1).standard_normal(test.signal_V.shape)
    miss = model.learner.estimate(noisy, noise_V).value - test.targets(("x0", "y0", "F"))
    return dict(zip(("x_mm", "y_mm", "F_N"), np.sqrt(np.mean(miss**2, axis=0)).tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Split:
    """Presses that train and presses that test."""

    signal: Array
    place: Array
    train: Index
    test: Index

    def distance(self, kept: Index) -> float:
        """Mean distance, mm, of tested presses from kernel ridge on some readings."""
        fitted = kernel_ridge.fit(self.signal[self.train][:, kept], self.place[self.train])
        return mean_distance(fitted.read(self.signal[self.test][:, kept]), self.place[self.test])

    def rows(self, part: str, skin: str, labels: int, **of: float) -> Iterator[dict[str, object]]:
        """One row for all readings, and one for each distance that is given."""
        whole = self.distance(np.arange(self.signal.shape[1]))
        shared = {"part": part, "skin": skin, "labels": labels}
        yield shared | {"what": "all", "readings": self.signal.shape[1], "distance_mm": whole}
        for what, miss in of.items():
            yield shared | {"what": what, "readings": ON_SKINS, "distance_mm": miss, "ratio": miss / whole}


def mean_distance(value: Array, place: Array) -> float:
    """Of places (n, 2) from others."""
    return float(np.linalg.norm(value - place, axis=1).mean())


def splits() -> Iterator[tuple[str, int, Split]]:
    """Skins and numbers of labels, 0 for all."""
    for skin in SKINS:
        _, presses, place = recorded(skin)
        for labels in LABELS:
            yield skin, labels, Split(presses.signal, place, *rows_of(Case(skin, labels, "time", "last"), len(place)))


def skin_rows(card: MaterialCard) -> Iterator[dict[str, object]]:
    """Mean distances with readings chosen by physics and by chance."""
    known: dict[Sensor, Index] = {}
    for skin, labels, one in splits():
        sensor = read_sensor(REAL / skin / "sensor.toml")
        pairs = pairs_of(sensor)
        if sensor not in known:
            slopes = touch_slopes(sensor.scene, card)
            known[sensor] = chosen(over_noise(slopes, pairs, pairs, 3), ON_SKINS,
                                   spread_before(slopes, sensor.scene)[:3])
        rng = np.random.default_rng(0)
        chance = [one.distance(np.sort(rng.permutation(len(pairs))[:ON_SKINS])) for _ in range(quick(2, 1))]
        yield from one.rows("skins", skin, labels, physics=one.distance(known[sensor]),
                            chance=float(np.mean(chance)))


def press_rows() -> Iterator[dict[str, object]]:
    """Mean distances with readings chosen by the training presses."""
    for skin, labels, one in splits():
        used = one.train[-MOST:]
        kept = by_presses(one.signal[used], one.place[used])
        yield from one.rows("presses", skin, labels, presses=one.distance(kept))


def by_presses(signal: Array, place: Array) -> Index:
    """(ON_SKINS,) readings by stepwise regression of waves of the place on a view of the readings; which view, and
    whether fine waves count, is what reads blocks best that were held out of choice and training."""
    views = (signal, direction(signal), compressed(signal, compression_scale(signal)))
    waves, blocks = draw_waves(place, 0).of(place), time_blocks(len(place))
    ways = list(itertools.product(views, (waves, waves[:, :2 + EACH])))

    def held_out(way: tuple[Array, Array]) -> float:
        value = np.empty_like(place)
        for block in np.unique(blocks):
            rest = blocks != block
            kept = stepwise(way[0][rest], way[1][rest])
            value[~rest] = kernel_ridge.fit(signal[rest][:, kept], place[rest]).read(signal[~rest][:, kept])
        return mean_distance(value, place)

    return stepwise(*min(ways, key=held_out))


def stepwise(signal: Array, target: Array) -> Index:
    """(ON_SKINS,) the readings that explain most of the targets one after the other, by linear regression."""
    left, aim = (signal - signal.mean(axis=0)) / signal.std(axis=0), target - target.mean(axis=0)
    taken: list[int] = []
    for _ in range(ON_SKINS):
        size = np.sum(left**2, axis=0) + RIDGE * len(signal)
        explained = np.sum((left.T @ aim) ** 2, axis=1) / size
        explained[taken] = -np.inf
        best = int(np.argmax(explained))
        taken.append(best)
        along = left[:, best] / np.sqrt(size[best])
        aim, left = aim - np.outer(along, along @ aim), left - np.outer(along, along @ left)
    return np.sort(taken)


def rows_of_part(part: str, card: MaterialCard, sweep: Path) -> Iterator[dict[str, object]]:
    """The rows of one part."""
    scene = Scene()
    if part == "bounds":
        return bound_rows(touch_slopes(scene, card), scene)
    if part == "drives":
        return drive_rows(scene, card)
    if part == "retrained":
        return retrained_rows(touch_slopes(scene, card, within_m=WITHIN_M), scene, read_samples(sweep))
    return skin_rows(card) if part == "skins" else press_rows()


def main(card_path: Path, sweep: Path, parts: Sequence[str]) -> None:
    """Write the rows of some parts and print them."""
    card = read_card(card_path)
    for part in parts:
        if part in ("skins", "presses") and not REAL.is_dir():
            print(f"{REAL} is not there; the real skins are left out.")
            continue
        rows = pd.DataFrame(list(rows_of_part(part, card, sweep)))
        shown(rows)
        table = earlier("sensor_design")
        kept = table[table["part"] != part] if len(table) else table
        written(pd.concat([kept, rows], ignore_index=True), "sensor_design")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:] or PARTS)
