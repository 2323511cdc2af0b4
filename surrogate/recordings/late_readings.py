"""Readings that a row holds late: a scan that runs on while the touch changes leaves its first readings to the frame
before, so that those of a touch stand in the frame that follows."""

import numpy as np

from surrogate.recordings.patterns import direction
from surrogate.statistics import left_out
from surrogate.statistics.gaussian_process import squared_distance
from touchcal.arrays import Array, Index

# Of the smoother: its length over the spread of the places, and the variance of noise over that of the process.
LENGTH, NOISE = 0.25, 0.05
SURE = 2.0  # times 1 / sqrt(presses): how much more of a reading places must explain a frame later
LEAST = 3  # readings that are late where any is: a scan that runs on leaves several, and chance one or two of hundreds
FEWEST = 40  # presses whose following frame is there, from which late readings are sought


def late_readings(signal: Array, following: Array, place: Array, press: Index | None = None) -> Index:
    """Numbers of the readings of signals (n, m) that places (n, 2) explain better in the frames that follow (n, m),
    NaN where these are not there: R^2 of a smoother that leaves the press (n,) of a row out, or the row alone where
    that is None."""
    there = np.flatnonzero(np.isfinite(following).all(axis=1) & np.isfinite(signal).all(axis=1))
    kept = there if press is None else press[there]
    count = len(np.unique(kept))
    if count < FEWEST:
        return np.zeros(0, np.intp)
    square = squared_distance(place[there], place[there]) / (LENGTH * place[there].std(axis=0).mean()) ** 2
    held_out = np.linalg.inv(np.exp(-square / 2) + NOISE * np.eye(len(there)))
    own, later = (_explained(held_out, frames[there], kept) for frames in (signal, following))
    late = np.flatnonzero((later > own + SURE / np.sqrt(count)) & (later > 0))
    return late if len(late) >= LEAST else late[:0]


def with_late(signal: Array, following: Array, late: Index) -> Array:
    """(n, m + late) signals (n, m), then the late readings of the frames that follow (n, m)."""
    return np.hstack([signal, following[:, late]])


def _explained(held_out: Array, frames: Array, press: Index) -> Array:
    """(m,) part of the variance of each reading's share of its frame that the smoother explains without its press."""
    share = direction(frames)
    share = share - share.mean(axis=0)
    left, _ = left_out.missed(left_out.of_matrix(held_out), held_out @ share, press)
    return 1 - np.sum(left**2, axis=0) / np.maximum(np.sum(share**2, axis=0), np.finfo(float).tiny)
