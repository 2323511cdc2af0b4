"""Readings that a row holds late: a scan that runs on while the touch changes leaves its first readings to the frame
before, so that those of a touch stand in the frame that follows."""

import numpy as np

from surrogate.recordings.patterns import direction
from surrogate.statistics.gaussian_process import squared_distance
from touchcal.arrays import Array, Index

# Of the smoother: its length over the spread of the places, and the variance of noise over that of the process.
LENGTH, NOISE = 0.25, 0.05
SURE = 2.0  # times 1 / sqrt(presses): how much more of a reading places must explain a frame later
FEWEST = 40  # presses whose following frame is there, from which late readings are sought


def late_readings(signal: Array, following: Array, place: Array) -> Index:
    """Numbers of the readings of signals (n, m) that places (n, 2) explain better in the frames that follow (n, m),
    NaN where these are not there: R^2 of a leave-one-out smoother."""
    there = np.flatnonzero(np.isfinite(following).all(axis=1) & np.isfinite(signal).all(axis=1))
    if len(there) < FEWEST:
        return np.zeros(0, np.intp)
    square = squared_distance(place[there], place[there]) / (LENGTH * place[there].std(axis=0).mean()) ** 2
    held_out = np.linalg.inv(np.exp(-square / 2) + NOISE * np.eye(len(there)))
    own, later = (_explained(held_out, frames[there]) for frames in (signal, following))
    return np.flatnonzero((later > own + SURE / np.sqrt(len(there))) & (later > 0))


def with_late(signal: Array, following: Array, late: Index) -> Array:
    """(n, m + late) signals (n, m), then the late readings of the frames that follow (n, m)."""
    return np.hstack([signal, following[:, late]])


def _explained(held_out: Array, frames: Array) -> Array:
    """(m,) part of the variance of each reading's share of its frame that the smoother explains, leave-one-out."""
    share = direction(frames)
    share = share - share.mean(axis=0)
    left = held_out @ share / np.diag(held_out)[:, None]
    return 1 - np.sum(left**2, axis=0) / np.maximum(np.sum(share**2, axis=0), np.finfo(float).tiny)
