"""Sensors, drives and choices of readings by how well they tell a touch: Cramer-Rao bounds of x, y, F over the disc."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.drive import READINGS, Drive
from eitsim.scene.electrodes import FEWEST
from eitsim.scene.scene import Scene, read_scene
from eitsim.sensors.layout.reading_choice import bounds, chosen
from eitsim.sensors.layout.touch_slopes import PLACES, UNKNOWNS, TouchSlopes, reading_slopes, touch_slopes, untouched_V
from eitsim.sensors.sensor_file import TABLES, Sensor, pairs_of, read_sensor
from matcal.card import MaterialCard
from touchcal.arrays import Array, Index
from touchcal.toml_file import read_toml

OWN = "own drive"
CANDIDATES = ("own", "all")  # the readings to choose from: those of the own drive, or of any four electrodes
MOST_CANDIDATES = 20_000  # readings of any four of 21 electrodes
MOST_DB = 300
HIGH = 0.9  # quantile over the places that is stated next to the median


@dataclass(frozen=True, eq=False)
class Rated:
    """How well some readings tell a touch."""

    name: str
    readings: int
    # (q,) median and 90 % quantile over the places of the least standard deviations, in the units of `SensorDesign`
    median: Array
    high: Array
    # least standard deviation over that of the own drive, geometric mean over places and unknowns
    over_own: float


@dataclass(frozen=True, eq=False)
class SensorDesign:
    """Drives of one sensor, the best first, and a choice of readings."""

    unknowns: tuple[str, ...]  # (q,) what a touch is read for, units in the names; all else of it is known
    noise_V: float  # standard deviation of one reading, V
    places: int  # touches over the disc
    drives: tuple[Rated, ...]
    choice: Rated | None  # None where no number of readings was given
    pairs: Index  # (readings, 4) source, sink, plus, minus of the choice, electrodes from 0; empty where there is none


def read_layout(path: Path) -> Scene:
    """The scene of a sensor file, or of a scene file, which has a punch; errors as those."""
    described = path.suffix == ".json" or set(read_toml(path)) <= set(TABLES)
    return read_sensor(path).scene if described else read_scene(path)


def design_sensor(scene: Scene, card: MaterialCard, *, noise_dB: float = 80.0, noise_V: float | None = None,
                  readings: int | None = None, candidates: str = "own", unknown_diameter: bool = False,
                  within_m: float | None = None, places: int = PLACES,
                  each: Callable[[Iterable[int]], Iterable[int]] = iter) -> SensorDesign:
    """Least standard deviations sqrt((J'J)^-1) s of x, y and F of a touch over the disc, by drive and choice.

    Parameters
    ----------
    scene : Scene
        Body, skin, electrodes, drive of pairs, and one punch under a force.
    card : MaterialCard
        Foam and skin.
    noise_dB, noise_V : float
        White noise s of one reading: dB below the RMS of the own drive's untouched readings, or V, which goes first.
    readings : int, optional
        How many readings to choose; none where left out.
    candidates : str
        What they are chosen from: "own", those of the scene's drive, or "all", of any four electrodes.
    unknown_diameter : bool
        Whether the diameter is unknown too.
    within_m : float, optional
        Touches lie within this radius, m; as far as the punch fits where left out.
    places : int
        Touches that are solved; an even ring turns each into one for every electrode.

    Returns
    -------
    SensorDesign
        Drives in order, and the choice.

    Raises
    ------
    ValueError
        Where the drive is not one of pairs, or as touch_slopes; for a noise that is not above 0 or too few readings.

    Examples
    --------
    >>> import eitsim
    >>> import matcal
    >>> foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
    >>> card = matcal.MaterialCard("foam", foam, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    >>> scene = eitsim.Scene(punches=[eitsim.Punch(force_N=0.2)], accuracy=eitsim.Accuracy(0.05))
    >>> found = eitsim.design_sensor(scene, card, readings=32, within_m=0.04, places=2)
    >>> len(found.drives), len(found.pairs)
    (17, 32)
    """
    if scene.electrodes.count <= FEWEST:
        raise ValueError(f"{FEWEST} electrodes leave nothing to choose; give more.")
    own = pairs_of(_sensor(scene))
    unknowns = UNKNOWNS if unknown_diameter else UNKNOWNS[:3]
    pool = candidate_pairs(own, scene.electrodes.count, candidates)
    if readings is not None and not len(unknowns) <= readings <= len(pool):
        raise ValueError(f"{readings} readings cannot tell {len(unknowns)} unknowns from {len(pool)} candidates; keep "
                         f"{len(unknowns)} to {len(pool)}.")
    if noise_V is not None and not 0 < noise_V < np.inf:
        raise ValueError(f"the noise of one reading must be above 0 V, got {noise_V:g}.")
    if not abs(noise_dB) <= MOST_DB:
        raise ValueError(f"the noise of one reading must lie {-MOST_DB} to {MOST_DB} dB below the readings, got "
                         f"{noise_dB:g}.")
    slopes = touch_slopes(scene, card, within_m=within_m, places=places, each=each)
    noise = noise_V or float(np.sqrt(np.mean(untouched_V(slopes, own) ** 2))) * 10 ** (-noise_dB / 20)

    def over_noise(pairs: Index) -> Array:
        return reading_slopes(slopes, pairs)[..., :len(unknowns)] / noise

    reference = bounds(over_noise(own))
    rated = [_rated(name, over_noise(pairs), reference) for name, pairs in _drives(scene, own)]
    design = SensorDesign(unknowns, noise, len(slopes.place_mm), tuple(sorted(rated, key=lambda one: one.over_own)),
                          None, own[:0])
    if readings is None:
        return design
    taken = pool[np.sort(chosen(over_noise(pool), readings, spread_before(slopes, scene)[:len(unknowns)]))]
    return replace(design, choice=_rated(f"chosen of {len(pool)}", over_noise(taken), reference), pairs=taken)


def _sensor(scene: Scene) -> Sensor:
    return Sensor(scene.body, scene.skin, scene.electrodes, scene.drive)


def spread_before(slopes: TouchSlopes, scene: Scene) -> Array:
    """(4,) what is known before a reading: x and y to the disc, F and d to their own sizes."""
    punch = scene.punches[0]
    assert punch.force_N is not None
    return np.array([*slopes.place_mm.std(axis=0), punch.force_N, punch.diameter_m * 1e3])


def candidate_pairs(own: Index, count: int, candidates: str) -> Index:
    """(readings, 4) the readings to choose from, of `own` or of any four of `count` electrodes."""
    if candidates not in CANDIDATES:
        raise ValueError(f"candidates '{candidates}' are unknown; known: {', '.join(CANDIDATES)}.")
    if candidates == "own":
        return own
    pairs = list(itertools.combinations(range(count), 2))
    every = np.array([(*a, *b) for a, b in itertools.combinations(pairs, 2) if not {*a} & {*b}])
    if len(every) > MOST_CANDIDATES:
        raise ValueError(f"{count} electrodes have {len(every)} readings of any four, too many to choose from. Choose "
                         "from those of the own drive.")
    return every


def _drives(scene: Scene, own: Index) -> Iterator[tuple[str, Index]]:
    """The own drive, then all named patterns and readings, up to opposite electrodes; larger skips mirror these."""
    yield OWN, own
    count = scene.electrodes.count
    for step, reading in itertools.product(range(1, count // 2 + 1), READINGS):
        pattern = {1: "adjacent", count / 2: "opposite"}.get(step, f"skip-{step - 1}")
        drive = Drive(scene.drive.current_A, pattern=pattern, reading=reading)
        yield f"{drive.pattern}, {reading}", pairs_of(_sensor(replace(scene, drive=drive)))


def _rated(name: str, by: Array, reference: Array) -> Rated:
    sd = bounds(by)
    return Rated(name, by.shape[1], np.median(sd, axis=0), np.quantile(sd, HIGH, axis=0),
                 float(np.exp(np.mean(np.log(sd / reference)))))


def design_document(design: SensorDesign) -> dict[str, Any]:
    """A design as JSON: noise, drives and choice with `median` and `high` by unknown."""
    return {"noise_V": design.noise_V, "places": design.places, "unknowns": design.unknowns,
            "drives": [_document(one, design.unknowns) for one in design.drives],
            "choice": None if design.choice is None else _document(design.choice, design.unknowns) | {
                "pairs": design.pairs}}


def _document(one: Rated, unknowns: Iterable[str]) -> dict[str, Any]:
    names = [f"sd_{name}" for name in unknowns]
    return {"name": one.name, "readings": one.readings, "over_own": one.over_own,
            "median": dict(zip(names, one.median.tolist(), strict=True)),
            "high_90": dict(zip(names, one.high.tolist(), strict=True))}
