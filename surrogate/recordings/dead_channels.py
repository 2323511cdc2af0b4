"""Readings of dead channels, filled in by what the others say of them."""

from dataclasses import dataclass

import numpy as np

from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Mask

RIDGE = 1e-3  # of the mean variance: readings are taken as no surer than this
MOST_KEPT = 100  # training signals that show what filling in costs


@dataclass(frozen=True, eq=False)
class Readings:
    """Normal distribution of the training signals."""

    mean: Array  # (m,)
    covariance: Array  # (m, m)
    presses: int  # that the training signals show
    kept: Array  # (k, m) some of them, evenly spread


def learn_readings(signal: Array, presses: int | None = None) -> Readings:
    """Mean and covariance of whole signals (n, m) of so many presses, each its own where that is None."""
    mean = signal.mean(axis=0)
    covariance = (signal - mean).T @ (signal - mean) / len(signal)
    covariance += RIDGE * np.trace(covariance) / len(mean) * np.eye(len(mean))
    return Readings(mean, covariance, len(signal) if presses is None else presses,
                    signal[spread_evenly(len(signal), MOST_KEPT)])


def filled(readings: Readings, signal: Array) -> Array:
    """Signals (n, m) with each NaN replaced by its mean given the other readings of its frame."""
    out = signal.copy()
    for row in np.flatnonzero(np.isnan(signal).any(axis=1)):
        dead = np.isnan(signal[row])
        alive = readings.covariance[np.ix_(~dead, ~dead)]
        left = np.linalg.solve(alive, signal[row, ~dead] - readings.mean[~dead])
        out[row, dead] = readings.mean[dead] + readings.covariance[np.ix_(dead, ~dead)] @ left
    return out


def filled_without(readings: Readings, dead: Mask) -> Array:
    """(k, m) the kept training signals with these readings (m,) filled in from what the training signals but their own
    say: with leverages h of the others, which are alive, residuals without a press are residuals over 1 - h, h counted
    once for each of its frames."""
    left = readings.kept - readings.mean
    alive = left[:, ~dead]
    weighted = np.linalg.solve(readings.covariance[np.ix_(~dead, ~dead)], alive.T)
    missed = left[:, dead] - (readings.covariance[np.ix_(dead, ~dead)] @ weighted).T
    out = readings.kept.copy()
    out[:, dead] -= missed / (1 - (1 + np.sum(alive.T * weighted, axis=0)) / readings.presses)[:, None]
    return out
