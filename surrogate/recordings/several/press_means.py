"""Frames of one press as their mean, and what frames of one press share: a mean of n frames has the covariance
R_n = L (S + W / n) L', R = L L' being that of the means of training, W of single frames about the mean of their press
and S of what all frames of a press share, both whitened. Drift, hysteresis and what patterns lack are shared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surrogate.recordings.presses import Presses, taken
from surrogate.recordings.several.superposition import shrunk
from touchcal.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class FrameNoise:
    """What frames of one press do not share."""

    own: Array  # (m, m) W
    shared: Array  # (m, m) S

    def of_mean(self, count: int) -> Array:
        """(m, m) whitened covariance of the mean of some frames of a press."""
        return self.shared + self.own / count


def press_numbers(presses: Presses) -> Index:
    """(n,) number of the press that each frame shows, by its name, in the order of their first frames; frames without a
    name are presses of their own."""
    rows = np.arange(len(presses.name)).astype(np.str_)
    key = np.where(presses.name == "", np.char.add("row ", rows), np.char.add("touch ", presses.name))
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse].astype(np.intp)


def first_frames(presses: Presses, press: Index) -> Presses:
    """The first frame of each press."""
    return taken(presses, np.unique(press, return_index=True)[1])


def means(press: Index, values: Array) -> Array:
    """(p, m) mean of each press, in the order of their numbers (n,), of the frames (n, m) that have a value; NaN where
    none has."""
    total, known = _sums(press, np.nan_to_num(values)), _sums(press, np.isfinite(values).astype(float))
    return np.divide(total, known, out=np.full_like(total, np.nan), where=known > 0)


def counts(press: Index, values: Array) -> Index:
    """(p,) frames of each press; where readings are dead in some of them, frames of the reading that has fewest."""
    known = _sums(press, np.isfinite(values).astype(float))
    return np.where(known > 0, known, np.inf).min(axis=1, initial=len(press)).astype(np.intp)


def frame_noise(press: Index, signal: Array, factor: Array) -> FrameNoise | None:
    """What frames of one press do not share, of signals (n, m) without dead readings, whose means have the covariance
    of this factor (m, m); None where no press has two frames, since nothing says then what they share."""
    _, place, count = np.unique(press, return_inverse=True, return_counts=True)
    several = count[place] > 1
    if not several.any():
        return None
    about = (signal - means(press, signal)[place]) * np.sqrt(count / np.maximum(count - 1, 1))[place, None]
    own = shrunk(np.asarray(np.linalg.solve(factor, about[several].T).T, np.float64))
    value, vector = np.linalg.eigh(np.eye(len(own)) - own * np.mean(1 / count))
    return FrameNoise(own, (vector * np.maximum(value, 0.0)) @ vector.T)


def _sums(press: Index, values: Array) -> Array:
    _, place = np.unique(press, return_inverse=True)
    out = np.zeros((int(place.max(initial=-1)) + 1, values.shape[1]))
    np.add.at(out, place, values)
    return out
