"""Readings that a row holds late: a scan that runs on while the touch changes leaves its first readings to the frame
before, so that those of a touch stand in the frame that follows."""

import numpy as np

from surrogate.recordings.patterns import direction
from surrogate.statistics import left_out
from surrogate.statistics.gaussian_process import squared_distance
from touchcal.arrays import Array, Index

# Of the smoother: its length over the spread of the places, times the root of the presses and at least; and the
# variance of noise over that of the process.
LENGTH, SHORTEST, NOISE = 3.0, 0.25, 0.05
FEWEST = 10  # presses whose following frame is there, from which late readings are sought
LEAST = 3  # readings that are late where any is: a scan that runs on leaves several
# Readings' worth of variance that the run must explain more a frame later: of fewer than ENOUGH presses chance reaches
# more.
MORE, ENOUGH = 2.0, 20


def late_readings(signal: Array, following: Array, place: Array, press: Index | None = None) -> Index:
    """The readings, a run from the first on, of signals (n, m) that places (n, 2) explain better in the frames that
    follow (n, m), NaN where these are not there: the run of the largest sum of differences of R^2, at least 0 each, of
    a smoother that leaves the press (n,) of a row out, or the row alone where that is None."""
    there = np.flatnonzero(np.isfinite(following).all(axis=1) & np.isfinite(signal).all(axis=1))
    kept = there if press is None else press[there]
    count = len(np.unique(kept))
    if count < FEWEST:
        return np.zeros(0, np.intp)
    length = max(LENGTH / np.sqrt(count), SHORTEST) * place[there].std(axis=0).mean()
    held_out = np.linalg.inv(np.exp(-squared_distance(place[there], place[there]) / (2 * length**2))
                             + NOISE * np.eye(len(there)))
    own, later = (np.maximum(_explained(held_out, frames[there], kept), 0) for frames in (signal, following))
    more = np.cumsum(later - own)
    run = int(more.argmax()) + 1
    return np.arange(run if run >= LEAST and more[run - 1] > MORE * max(ENOUGH / count, 1) else 0)


def with_late(signal: Array, following: Array, late: Index) -> Array:
    """(n, m + late) signals (n, m), then the late readings of the frames that follow (n, m)."""
    return np.hstack([signal, following[:, late]])


def _explained(held_out: Array, frames: Array, press: Index) -> Array:
    """(m,) part of the variance of each reading's share of its frame that the smoother explains without its press."""
    share = direction(frames)
    share = share - share.mean(axis=0)
    left, _ = left_out.missed(left_out.of_matrix(held_out), held_out @ share, press)
    return 1 - np.sum(left**2, axis=0) / np.maximum(np.sum(share**2, axis=0), np.finfo(float).tiny)
