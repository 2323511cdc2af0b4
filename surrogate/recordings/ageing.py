"""Presses against untouched frames that are older than those recorded with them, to learn what age costs: a random walk
drifts backwards as it does forwards, so that later frames serve as well as earlier ones."""

from dataclasses import dataclass, replace

import numpy as np

from surrogate.recordings.baselines import interpolated
from surrogate.recordings.presses import Presses, whole_rest
from surrogate.recordings.signals import OLD, Signals, learn_signals
from surrogate.statistics.conformal import Bounds, Intervals, calibrated
from touchcal.arrays import Array, Index

FEWEST_AGED = 20  # presses that have an untouched frame of some age
NEAR = 0.75  # of an age: a frame that is at least so old stands for it


@dataclass(frozen=True, eq=False)
class Aged:
    """Presses as older untouched frames would show them."""

    age: float  # in the unit of `Presses.age`
    rows: Index  # presses that have such a frame
    signal: Array  # (n, m + late); as recorded where there is none


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of training presses before a label is looked at."""

    signals: Signals
    signal: Array  # (n, m + late)
    aged: tuple[Aged, ...]  # by age


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Places read of training presses that were held out, (n, 2) each, mm."""

    place: Array
    cut: Array  # without the frames that follow
    old: Array  # as if the untouched frames were old
    aged: tuple[Array, ...]  # of each of `Known.aged`
    widening: Array  # (n,) factor of intervals that comes of unlike and of distant patterns


@dataclass(frozen=True, eq=False)
class OldReadings:
    """What is made of values by the age of the untouched frame: mean + gain (value - mean), and its intervals."""

    age: Array  # (a,) ascending from 0
    mean: Array  # (k,) of the label
    gain: Array  # (a,) from 0, where old frames say nothing, to 1
    intervals: tuple[Intervals, ...]  # (a,)

    def read(self, age: Array, value: Array, spread: Array) -> tuple[Array, Bounds]:
        """Values (n, k) and bounds of frames of these ages (n,) and spreads (n, k): between those of the ages next to
        it, or those of the greatest."""
        place = np.interp(age, self.age, np.arange(len(self.age)))
        below, rows = np.floor(place).astype(np.intp), np.arange(len(spread))
        above, share = np.ceil(place).astype(np.intp), place - below
        gain = np.interp(age, self.age, self.gain)[:, None]
        each = [one.bounds(gain * spread, np.zeros(len(spread))) for one in self.intervals]
        stacks = [np.stack([getattr(one, name) for one in each]) for name in ("half_width", "correlation", "ellipse")]
        bounds = Bounds(*((stack[below, rows].T * (1 - share) + stack[above, rows].T * share).T for stack in stacks))
        return self.mean + gain * (value - self.mean), bounds


def learn_known(presses: Presses, late: Index, count: int | None = None) -> Known:
    """What training frames, of so many presses, say of signals, and untouched frames without a dead channel of drift
    and age; ValueError as learn_signals."""
    presses = whole_rest(presses)
    signals, signal = learn_signals(presses, late, count)
    aged = _aged(signals, presses, signal)
    oldest = aged[-1].age if aged else signals.greatest_age
    return Known(replace(signals, oldest=oldest), signal, aged)


def calibrated_by_age(aged: tuple[Aged, ...], target: Array, fresh: tuple[Array, Array],
                      seen: tuple[tuple[Array, Array], ...], press: Index) -> OldReadings:
    """Gain, of least squares, and intervals for each age from what is read of held-out presses, values and spreads
    (n, k) of targets (n, k), of presses (n,), and of these as `aged` shows them."""
    mean, gain, intervals = target.mean(axis=0), [], []
    rows = [np.arange(len(target)), *(one.rows for one in aged)]
    for kept, (value, spread) in zip(rows, (fresh, *seen), strict=True):
        read, right = value[kept] - mean, target[kept] - mean
        gain.append(float(np.clip(np.sum(read * right) / max(np.sum(read**2), np.finfo(float).tiny), 0, 1)))
        intervals.append(calibrated(gain[-1] * read - right, gain[-1] * spread[kept], np.zeros(len(kept)),
                                    len(np.unique(press[kept]))))
    return OldReadings(np.array([0.0, *(one.age for one in aged)]), mean, np.array(gain), tuple(intervals))


def _aged(signals: Signals, presses: Presses, signal: Array) -> tuple[Aged, ...]:
    """Presses against untouched frames twice as old as any in training, four times ..., as far as FEWEST_AGED presses
    have one; none where nothing is known of drift."""
    if not len(signals.drift.root):
        return ()
    rest = np.hstack([presses.rest, presses.rest[:, signals.late]])
    now, _ = interpolated(rest, presses.rest_time, presses.time)
    apart = np.abs(presses.time[:, None] - presses.rest_time)
    views, age = [], OLD * max(signals.greatest_age, float(np.diff(np.unique(presses.rest_time)).min()))
    while age <= apart.max():
        nearest = np.argmin(np.abs(apart - age), axis=1)
        rows = np.flatnonzero(apart[np.arange(len(nearest)), nearest] >= NEAR * age)
        if len(rows) < FEWEST_AGED:
            break
        older = signal.copy()
        older[rows] += now[rows] - rest[nearest[rows]]
        views.append(Aged(age, rows, older))
        age *= 2
    return tuple(views)
