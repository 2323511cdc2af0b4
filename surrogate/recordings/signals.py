"""What is done to the readings of a press before a family of readers takes them: late readings are appended, dead
channels filled in, directions of drift taken out."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate.data.dead_readings import named, teaching_nothing, too_many
from surrogate.data.flags import Flag, in_words
from surrogate.recordings.baselines import Drift, interpolated, learn_drift
from surrogate.recordings.dead_channels import Readings, filled, learn_readings
from surrogate.recordings.late_readings import with_late
from surrogate.recordings.presses import Presses
from touchcal.arrays import Array, Index, Mask

FEWEST = 10  # presses to learn from
OLD = 2.0  # times the greatest age of an untouched frame in training: one that is older is read by what drift spares
WEAK = 0.3  # of the weakest training signal
UNUSED = 0.01  # part of the training signals that is stronger than what a signal may be without a flag
STRONGER = 1.1  # times the strongest training signal but these: a signal is stronger than those of training
REACH = 3.0  # times how far an untouched frame of training is from their mean at most, and once a usual signal: moved


@dataclass(frozen=True, eq=False)
class Signals:
    """What training presses say of signals."""

    late: Index  # readings that the frame which follows holds
    readings: Readings  # of the signals with the late readings appended
    drift: Drift  # likewise
    greatest_age: float  # of an untouched frame in training; infinite of differences, which say nothing of it
    oldest: float  # greatest age of an untouched frame whose cost was learnt
    weakest: float  # norm of the weakest training signal
    strongest: float  # norm that a part UNUSED of training signals exceeds, or the strongest
    rest: Array  # (m,) mean untouched frame of training; NaN where there is none, and of silent channels
    moved: float  # distance from it above which an untouched frame is unlike those of training
    clocked: bool  # whether ages are in s, and not in frames
    gain: Array | None = None  # (m + late,) factors that bring another session's signals to the training's

    @property
    def channels(self) -> int:
        """Readings of a frame."""
        return len(self.readings.mean) - len(self.late)

    @property
    def silent(self) -> Mask:
        """(m + late,) readings that had no signal in any training press, so that nothing is known of them."""
        return (self.readings.mean == 0) & ~self.readings.kept.any(axis=0)

    def whole(self, presses: Presses) -> Array:
        """(n, m + late) signals of presses, dead channels filled in and silent ones 0."""
        signal = np.where(self.silent, 0.0, with_late(presses.signal, presses.following, self.late))
        return filled(self.readings, signal if self.gain is None else signal * self.gain)

    def presses(self, signal: Array) -> Presses:
        """Presses of these signals (n, m + late), against untouched frames of age 0."""
        signal = signal if self.gain is None else signal / self.gain
        following = np.full((len(signal), self.channels), np.nan)
        following[:, self.late] = signal[:, self.channels:]
        none = np.zeros(len(signal))
        return Presses(none.astype(np.str_), none.astype(np.int64), signal[:, :self.channels], following, none,
                       following[:0], none[:0], none, self.clocked)

    def cut(self, presses: Presses) -> Mask:
        """(n,) whether the frame that follows should hold readings of a press and is not there; late readings of
        channels that are dead in the press as well are not missed."""
        lost, dead = (np.isnan(one[:, self.late]) for one in (presses.following, presses.signal))
        return np.all(lost, axis=1) & ~np.all(dead, axis=1)

    def dead(self, presses: Presses) -> Mask:
        """(n, m + late) which readings dead channels leave out, but for silent ones; late ones of a frame that is not
        there count by the channels of the press."""
        dead, lost = np.isnan(presses.signal), np.isnan(presses.following)
        late = np.where(self.cut(presses)[:, None], dead[:, self.late], lost[:, self.late])
        return np.hstack([dead, late]) & ~self.silent

    def old(self, presses: Presses) -> Mask:
        """(n,) whether the untouched frame is far older than any in training."""
        return presses.age > OLD * self.greatest_age

    def elsewhere(self, presses: Presses) -> Mask:
        """(n,) whether the untouched frame is unlike those of training: that of another session, or another sensor."""
        if not len(presses.rest):
            return np.zeros(len(presses.signal), bool)
        frame, _ = interpolated(presses.rest, presses.rest_time, presses.time)
        return np.sqrt(np.nansum((frame - self.rest) ** 2, axis=1)) > self.moved

    def spared(self, presses: Presses) -> Mask:
        """(n,) whether it is, and what drifts is known, so that what drift spares is read."""
        return self.old(presses) & (len(self.drift.root) > 0)


def learn_signals(presses: Presses, late: Index, count: int | None = None) -> tuple[Signals, Array]:
    """What training frames, of so many presses, say of signals, and their signals (n, m + late); ValueError where fewer
    than FEWEST of them are without dead channels."""
    signal = with_late(presses.signal, presses.following, late)
    whole = ~np.isnan(signal).any(axis=1)
    if whole.sum() < FEWEST:
        out = teaching_nothing(np.isnan(signal), FEWEST)
        out[late] |= out[presses.signal.shape[1]:]
        names = named(out[:presses.signal.shape[1]], presses.columns)
        raise ValueError(f"{names} dead in so many labelled presses that {whole.sum()} of {len(signal)} have all "
                         f"readings; {FEWEST} or more must. Leave these columns out of recording and sensor.")
    readings = learn_readings(signal[whole], count)
    signal = filled(readings, signal)
    drift = learn_drift(np.hstack([presses.rest, presses.rest[:, late]]), presses.rest_time)
    age = float(presses.age.max()) if len(presses.rest) else np.inf
    size = np.sort(np.linalg.norm(signal, axis=1))
    strongest = float(size[min(math.ceil((len(size) + 1) * (1 - UNUSED)), len(size)) - 1])
    rest = presses.rest.mean(axis=0) if len(presses.rest) else np.full(presses.rest.shape[1], np.nan)
    rest[~signal[:, :len(rest)].any(axis=0)] = np.nan
    reach = float(np.sqrt(np.nansum((presses.rest - rest) ** 2, axis=1)).max(initial=0.0))
    return Signals(late, readings, drift, age, age, float(size[0]), strongest, rest,
                   REACH * reach + float(np.median(size)), presses.clocked), signal


def flags(signals: Signals, presses: Presses, strange: Mask) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """(n,) why not to trust a press, as a sum of `Flag`, `strange` those whose pattern is, and in words; 0 and empty
    where nothing speaks against it."""
    lost = [too_many(row) for row in np.isnan(presses.signal)]
    size, old = np.linalg.norm(signals.whole(presses), axis=1), signals.old(presses)
    beyond = old & (presses.age > signals.oldest)
    masks = {Flag.TOO_FEW: np.array([*map(bool, lost)], bool), Flag.NOTHING_FOLLOWS: signals.cut(presses),
             Flag.OLD: old & ~beyond, Flag.TOO_OLD: beyond, Flag.OTHER_PATTERN: strange,
             Flag.WEAK: size < WEAK * signals.weakest,
             Flag.STRONG: size > STRONGER * signals.strongest, Flag.OTHER_SESSION: signals.elsewhere(presses)}
    kinds = sum((int(kind) * mask for kind, mask in masks.items()), np.zeros(len(lost), np.int64))
    return kinds, tuple(words or in_words(kind) for kind, words in zip(kinds.tolist(), lost, strict=True))
