"""Times of a spectrum that are searched: a material of few terms has few, where times that are given split each.

Terms are added one by one where they lower the misfit most, and all times are searched again with each, coefficients
solved for; the BIC, in which every searched time counts, says how many there are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from matcal.fitting.relaxation.linear_spectrum import AtTimes, LinearSpectrum, at_times, positive, stacked
from touchcal.arrays import Array

# how far past what was seen a time is searched, and how far from the others a new one begins, as ratios
_FURTHER, _APART = 10.0, 1.4
_BEAM, _WORSE = 2, 2  # places of a new term that are tried; further terms that may raise the BIC before the search ends
_TURNS, _STEP = 3, 1e-6  # turns of times and of weights of the channels; step of ln times for slopes


def free_times(model: LinearSpectrum, ends_s: tuple[float, float], given: AtTimes) -> AtTimes:
    """The spectrum with the least BIC of those whose times are searched, a new one near one of the `given` times.

    It has about as many numbers as the given one has shares, not more, and fewer than the first channel has values.
    """
    most = min((np.count_nonzero(given.found) + 1) // 2, (model.channels[0].size - 2) // 2)
    best = now = at_times(model, np.empty(0))
    while now.times_s.size < min(most, best.times_s.size + _WORSE):
        starts = _one_more(model, now, given.times_s)
        if not starts:
            break
        now = min((_searched(model, at_times(model, s), ends_s) for s in starts), key=lambda one: _bic(model, one))
        best = min(best, now, key=lambda one: _bic(model, one))
    return best


def _bic(model: LinearSpectrum, one: AtTimes) -> float:
    return one.row(model, one.times_s.size)[2]


def _one_more(model: LinearSpectrum, now: AtTimes, grid_s: Array) -> list[Array]:
    """The times with one more, where that lowers the misfit most."""
    free = [t for t in grid_s if np.all(np.abs(np.log(t / now.times_s)) >= np.log(_APART))]
    misfits = [positive(model.relative(np.r_[now.times_s, t]), _weights(now))[1] for t in free]
    return [np.sort(np.r_[now.times_s, free[k]]) for k in np.argsort(misfits, kind="stable")[:_BEAM]]


def _weights(one: AtTimes) -> list[float]:
    return [max(r, one.rms[0]) for r in one.rms]


def _searched(model: LinearSpectrum, first: AtTimes, ends_s: tuple[float, float]) -> AtTimes:
    """The best times near `first`, and the weights of the channels by turns."""
    low, high = np.log(ends_s[0] / _FURTHER), np.log(ends_s[1] * _FURTHER)
    out = first
    for _ in range(_TURNS):
        left = _Left(model, _weights(out))
        start = np.clip(np.log(out.times_s), low + 1e-6, high - 1e-6)
        by = least_squares(left, start, left.slopes, (low, high), xtol=1e-8, ftol=1e-6,  # pyright: ignore[reportArgumentType]
                           max_nfev=30)
        out = at_times(model, np.exp(np.sort(by.x)))
    return out


@dataclass(frozen=True)
class _Left:
    """What the best coefficients at ln times leave, and its slopes with these coefficients (Kaufman)."""

    model: LinearSpectrum
    weights: Sequence[float]  # of each channel

    def __call__(self, ln_times: Array) -> Array:
        """(n,) weighted relative residuals."""
        blocks = self.model.relative(np.exp(ln_times))
        rows, right = stacked(blocks, self.weights)
        return rows @ positive(blocks, self.weights)[0] - right

    def slopes(self, ln_times: Array) -> Array:
        """(n, M) by each ln time."""
        blocks = self.model.relative(np.exp(ln_times))
        rows, found = stacked(blocks, self.weights)[0], positive(blocks, self.weights)[0]
        moved = stacked(self.model.relative(np.exp(ln_times + _STEP)), self.weights)[0]
        by_time = (moved - rows)[:, 1:] / _STEP * found[1:]
        q = np.linalg.qr(rows[:, found > 0])[0]
        return by_time - q @ (q.T @ by_time)
