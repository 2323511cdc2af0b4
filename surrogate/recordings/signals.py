"""What is done to the readings of a press before a family of readers takes them: late readings are appended, dead
channels filled in, directions of drift taken out."""

from dataclasses import dataclass

import numpy as np

from surrogate.data.dead_readings import too_many
from surrogate.recordings.baselines import Drift, learn_drift
from surrogate.recordings.dead_channels import Readings, filled, learn_readings
from surrogate.recordings.late_readings import with_late
from surrogate.recordings.presses import Presses
from touchcal.arrays import Array, Index, Mask

FEWEST = 10  # presses to learn from
OLD = 2.0  # times the greatest age of an untouched frame in training: one that is older is read by what drift spares
WEAK = 0.3  # of the weakest training signal


@dataclass(frozen=True, eq=False)
class Signals:
    """What training presses say of signals."""

    late: Index  # readings that the frame which follows holds
    readings: Readings  # of the signals with the late readings appended
    drift: Drift  # likewise
    greatest_age: float  # of an untouched frame in training; infinite of differences, which say nothing of it
    oldest: float  # greatest age of an untouched frame whose cost was learnt
    weakest: float  # norm of the weakest training signal
    clocked: bool  # whether ages are in s, and not in frames

    @property
    def channels(self) -> int:
        """Readings of a frame."""
        return len(self.readings.mean) - len(self.late)

    def whole(self, presses: Presses) -> Array:
        """(n, m + late) signals of presses, dead channels filled in."""
        return filled(self.readings, with_late(presses.signal, presses.following, self.late))

    def presses(self, signal: Array) -> Presses:
        """Presses of these signals (n, m + late), against untouched frames of age 0."""
        following = np.full((len(signal), self.channels), np.nan)
        following[:, self.late] = signal[:, self.channels:]
        none = np.zeros(len(signal))
        return Presses(none.astype(np.str_), none.astype(np.int64), signal[:, :self.channels], following, none,
                       following[:0], none[:0], none, self.clocked)

    def cut(self, presses: Presses) -> Mask:
        """(n,) whether the frame that follows should hold readings of a press and is not there."""
        return np.isnan(presses.following[:, self.late]).sum(axis=1) > 0

    def old(self, presses: Presses) -> Mask:
        """(n,) whether the untouched frame is far older than any in training."""
        return presses.age > OLD * self.greatest_age

    def spared(self, presses: Presses) -> Mask:
        """(n,) whether it is, and what drifts is known, so that what drift spares is read."""
        return self.old(presses) & (len(self.drift.root) > 0)


def learn_signals(presses: Presses, late: Index, count: int | None = None) -> tuple[Signals, Array]:
    """What training frames, of so many presses, say of signals, and their signals (n, m + late); ValueError where fewer
    than FEWEST of them are without dead channels."""
    signal = with_late(presses.signal, presses.following, late)
    whole = ~np.isnan(signal).any(axis=1)
    if whole.sum() < FEWEST:
        dead = np.flatnonzero(np.isnan(signal).any(axis=0))
        raise ValueError(f"readings {', '.join(f'v_{number:03d}' for number in dead[:5])} are dead in most labelled "
                         f"presses; {FEWEST} or more must be whole. Leave these columns out of recording and sensor.")
    readings = learn_readings(signal[whole], count)
    signal = filled(readings, signal)
    drift = learn_drift(np.hstack([presses.rest, presses.rest[:, late]]), presses.rest_time)
    age = float(presses.age.max()) if len(presses.rest) else np.inf
    weakest = float(np.linalg.norm(signal, axis=1).min())
    return Signals(late, readings, drift, age, age, weakest, presses.clocked), signal


def flags(signals: Signals, presses: Presses, strange: Mask) -> tuple[str, ...]:
    """(n,) why not to trust a press, `strange` those whose pattern is; empty where nothing speaks against it."""
    dead = np.isnan(presses.signal)
    weak = np.linalg.norm(signals.whole(presses), axis=1) < WEAK * signals.weakest
    old = signals.old(presses)
    beyond = old & (presses.age > signals.oldest)
    words = [(signals.cut(presses), "the frame that follows, which holds some readings of this one, is not there"),
             (old & ~beyond, "the untouched frame is older than any in training, and the intervals are wider for it"),
             (beyond, "the untouched frame is older than any in training, and so much that the intervals may not hold"),
             (strange, "a pattern unlike those of the training presses"),
             (weak, "weaker than any training press")]
    return tuple(too_many(one) or "; ".join([f"{one.sum()} dead channels filled in"] * bool(one.any())
                                            + [text for mask, text in words if mask[row]])
                 for row, one in enumerate(dead))


