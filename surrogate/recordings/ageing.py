"""Presses against untouched frames that are older than those recorded with them, to learn what age costs: a random walk
drifts backwards as it does forwards, so that later frames serve as well as earlier ones."""

from dataclasses import dataclass, replace

import numpy as np

from surrogate.recordings.baselines import interpolated, without
from surrogate.recordings.intervals import Bounds, Intervals, calibrated
from surrogate.recordings.presses import Presses
from surrogate.recordings.signals import OLD, Signals, learn_signals
from touchcal.arrays import Array, Index

FEWEST_AGED = 20  # presses that have an untouched frame of some age
PROJECTED_OLD = 6  # directions of drift that are taken out of a signal whose untouched frame is old
NEAR = 0.75  # of an age: a frame that is at least so old stands for it


@dataclass(frozen=True, eq=False)
class Aged:
    """Presses as older untouched frames would show them, PROJECTED_OLD directions of drift taken out."""

    age: float  # in the unit of `Presses.age`
    rows: Index  # presses that have such a frame
    signal: Array  # (n, m + late); as recorded where there is none


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of training presses before a label is looked at."""

    signals: Signals
    signal: Array  # (n, m + late)
    spared: Array  # (n, m + late) likewise, PROJECTED_OLD directions of drift taken out
    aged: tuple[Aged, ...]  # by age


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Places read of training presses that were held out, (n, 2) each, mm."""

    place: Array
    cut: Array  # without the frames that follow
    old: Array  # of `Known.spared`
    aged: tuple[Array, ...]  # of each of `Known.aged`


@dataclass(frozen=True, eq=False)
class OldIntervals:
    """Intervals by the age of the untouched frame."""

    age: Array  # (a,) ascending from 0
    intervals: tuple[Intervals, ...]  # (a,)

    def bounds(self, age: Array, spread: Array) -> Bounds:
        """Bounds of frames of these ages (n,) and spreads (n, k): those of the next greater age, or of the greatest."""
        step = np.minimum(np.searchsorted(self.age, age), len(self.age) - 1)
        each = [one.bounds(spread, np.zeros(len(spread))) for one in self.intervals]
        rows = np.arange(len(spread))
        return Bounds(*(np.stack([getattr(one, name) for one in each])[step, rows]
                        for name in ("half_width", "correlation", "ellipse")))


def learn_known(presses: Presses, late: Index) -> Known:
    """What training presses say of signals, drift and age; ValueError as learn_signals."""
    signals, signal = learn_signals(presses, late)
    aged = _aged(signals, presses, signal)
    oldest = aged[-1].age if aged else signals.greatest_age
    return Known(replace(signals, oldest=oldest), signal, without(signals.drift, signal, PROJECTED_OLD), aged)


def calibrated_by_age(aged: tuple[Aged, ...], target: Array, fresh: tuple[Array, Array],
                      seen: tuple[tuple[Array, Array], ...]) -> OldIntervals:
    """Intervals for each age from what is read of held-out presses, values and spreads (n, k) of targets (n, k), and of
    these as `aged` shows them."""
    rows = [np.arange(len(target)), *(one.rows for one in aged)]
    found = [calibrated((value - target)[kept], spread[kept], np.zeros(len(kept)))
             for kept, (value, spread) in zip(rows, (fresh, *seen), strict=True)]
    return OldIntervals(np.array([0.0, *(one.age for one in aged)]), tuple(found))


def _aged(signals: Signals, presses: Presses, signal: Array) -> tuple[Aged, ...]:
    """Presses against untouched frames twice as old as any in training, four times ..., as far as FEWEST_AGED presses
    have one; none where nothing is known of drift."""
    if not len(signals.drift.root):
        return ()
    rest = np.hstack([presses.rest, presses.rest[:, signals.late]])
    now, _ = interpolated(rest, presses.rest_time, presses.time)
    apart = np.abs(presses.time[:, None] - presses.rest_time)
    views, age = [], OLD * max(signals.greatest_age, float(np.diff(presses.rest_time).min()))
    while age <= apart.max():
        nearest = np.argmin(np.abs(apart - age), axis=1)
        rows = np.flatnonzero(apart[np.arange(len(nearest)), nearest] >= NEAR * age)
        if len(rows) < FEWEST_AGED:
            break
        older = signal.copy()
        older[rows] += now[rows] - rest[nearest[rows]]
        views.append(Aged(age, rows, without(signals.drift, older, PROJECTED_OLD)))
        age *= 2
    return tuple(views)
