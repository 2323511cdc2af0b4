"""How unlike the held-out training rows new rows are, by misfits that a fit leaves of them: intervals grow with it.

A row whose misfit, a squared distance, is k times what nine of ten held-out rows have at most gets intervals sqrt(k)
times as wide (Birge, The calculation of errors by the method of least squares, Phys. Rev. 40, 207, 1932). Rows that
were recorded together may be another session as a whole, in which the map has changed where single rows stay usual:
where their median misfit is surely k times the held-out one, all get intervals sqrt(k) times as wide. Of enough
held-out rows that median is known as well, and k is not chance; then it says that the session is another one, but
hardly by how much places err: each row's own intervals are sqrt(k) times as wide, ELSEWHERE times at most. Not so where
most rows are odd, since the others are not so by luck.
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
# Chosen on eleven pairs of recordings, early and late, of four skins: intervals of places without a flag hold 87 to
# 98 % with it from k = 1 on (84 to 100 without); on seven others 90 to 97 % (87 to 100). Small k came later.
ELSEWHERE = 1.3


@dataclass(frozen=True, eq=False)
class Unlikeness:
    """What held-out rows have of k misfits."""

    usual: Array  # (k,) what USUAL of the rows have at most
    most: Array  # (k,) MARGIN times what all but SELDOM of the rows have at most, all misfits together
    middle: Array  # (k,) medians
    spread: Array  # (k,) standard deviations of the logarithms
    rows: int  # held out

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
        return math.sqrt(max(self._surely(misfit, 1 / len(misfit)), 1.0)) if len(misfit) >= TOGETHER else 1.0

    def of_session(self, misfit: Array, together: Array) -> Array:
        """(n,) factor of the intervals of rows of misfits (n, k), of a session that others (m, k) show as a whole."""
        own = self.widening(misfit)
        if len(together) < TOGETHER or self.odd(np.median(together, axis=0)[None])[0]:
            return np.maximum(own, self.shift(together))
        other = self._surely(together, 1 / len(together) + 1 / self.rows)
        return own * min(math.sqrt(other), ELSEWHERE) if other > 1 else np.maximum(own, self.shift(together))

    def _surely(self, misfit: Array, share: float) -> float:
        """Least factor of the median of misfits (n, k) over the held-out ones, of so large a variance over that of
        single rows; medians are of normal logarithms."""
        unsure = SURE * self.spread * math.sqrt(math.pi / 2 * share)
        return float(np.max(np.median(misfit, axis=0) / self.middle * np.exp(-unsure)))


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
    return Unlikeness(usual, most, np.maximum(middle, tiny), spread, rows)


def _order(values: Array, part: float) -> Array:
    """(k,) what a new one of exchangeable rows (n, k) has at most with this probability; the largest of few rows."""
    return np.sort(values, axis=0)[min(math.ceil((len(values) + 1) * part), len(values)) - 1]
