"""Readings of dead channels, filled in by what the others say of them."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array

RIDGE = 1e-3  # of the mean variance: readings are taken as no surer than this


@dataclass(frozen=True, eq=False)
class Readings:
    """Normal distribution of the training signals."""

    mean: Array  # (m,)
    covariance: Array  # (m, m)


def learn_readings(signal: Array) -> Readings:
    """Mean and covariance of whole signals (n, m)."""
    mean = signal.mean(axis=0)
    covariance = (signal - mean).T @ (signal - mean) / len(signal)
    return Readings(mean, covariance + RIDGE * np.trace(covariance) / len(mean) * np.eye(len(mean)))


def filled(readings: Readings, signal: Array) -> Array:
    """Signals (n, m) with each NaN replaced by its mean given the other readings of its frame."""
    out = signal.copy()
    for row in np.flatnonzero(np.isnan(signal).any(axis=1)):
        dead = np.isnan(signal[row])
        alive = readings.covariance[np.ix_(~dead, ~dead)]
        left = np.linalg.solve(alive, signal[row, ~dead] - readings.mean[~dead])
        out[row, dead] = readings.mean[dead] + readings.covariance[np.ix_(dead, ~dead)] @ left
    return out
