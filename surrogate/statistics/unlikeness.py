"""How unlike the held-out training rows new rows are, by misfits that a fit leaves of them: intervals grow with it.

A row whose misfit, a squared distance, is k times what nine of ten held-out rows have at most gets intervals sqrt(k)
times as wide (Birge, The calculation of errors by the method of least squares, Phys. Rev. 40, 207, 1932). Rows that
were recorded together may be another session as a whole, in which the map has changed where single rows stay usual:
where their median misfit is surely k times the held-out one, all get intervals sqrt(k) times as wide.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from touchcal.arrays import Array, Mask

USUAL, SELDOM = 0.9, 0.0125  # part of held-out rows that is usual, and part that is odder than what is not flagged
MARGIN = 1.25  # times what these have at most: the largest misfit of few held-out rows is a noisy bound
# Of rows too few for that part, the bound is no lower than where a new one of log-normal misfits lies as seldom.
TOGETHER, SURE = 10, 1.65  # rows from which on they are compared as a whole, and standard errors that this must exceed


@dataclass(frozen=True, eq=False)
class Unlikeness:
    """What held-out rows have of k misfits."""

    usual: Array  # (k,) what USUAL of the rows have at most
    most: Array  # (k,) MARGIN times what all but SELDOM of the rows have at most, all misfits together
    middle: Array  # (k,) medians
    spread: Array  # (k,) standard deviations of the logarithms

    def ratio(self, misfit: Array) -> Array:
        """(n,) misfits (n, k) over the usual ones, the largest of each row."""
        return np.max(misfit / self.usual, axis=1)

    def odd(self, misfit: Array) -> Mask:
        """(n,) whether rows of misfits (n, k) are unlike nearly all held-out ones."""
        return np.any(misfit > self.most, axis=1)

    def widening(self, misfit: Array) -> Array:
        """(n,) factor of the intervals of rows of misfits (n, k), each taken by itself."""
        return np.sqrt(np.maximum(self.ratio(misfit), 1.0))

    def shift(self, misfit: Array) -> float:
        """Factor of the intervals of all rows of misfits (n, k) that were recorded together; 1 of fewer than
        TOGETHER."""
        if len(misfit) < TOGETHER:
            return 1.0
        unsure = SURE * self.spread * math.sqrt(math.pi / 2 / len(misfit))  # of a median of normal logarithms
        return math.sqrt(max(float(np.max(np.median(misfit, axis=0) / self.middle * np.exp(-unsure))), 1.0))


def learn_unlikeness(misfit: Array) -> Unlikeness:
    """What misfits (n, k) of held-out rows say of new ones."""
    tiny = np.finfo(float).tiny
    usual = np.maximum(_order(misfit, USUAL), tiny)
    rows, seldom = len(misfit), SELDOM / misfit.shape[1]
    most = np.maximum(MARGIN * _order(misfit, 1 - seldom), tiny)
    logs = np.log(np.maximum(misfit, tiny))
    middle, spread = np.median(misfit, axis=0), logs.std(axis=0)
    if (rows + 1) * seldom < 1:
        wide = stdtrit(rows - 1, 1 - seldom) * math.sqrt((rows + 1) / (rows - 1))
        most = np.maximum(most, np.exp(logs.mean(axis=0) + wide * spread))
    return Unlikeness(usual, most, np.maximum(middle, tiny), spread)


def _order(values: Array, part: float) -> Array:
    """(k,) what a new one of exchangeable rows (n, k) has at most with this probability; the largest of few rows."""
    return np.sort(values, axis=0)[min(math.ceil((len(values) + 1) * part), len(values)) - 1]
