"""What a term slower than those fitted would change, which a hold of finite length neither shows nor excludes.

One more term with a time of once, or three times, the hold is given as large a share as the holds allow: the root of
the sum of its best share's square and of that share's variance, every other number of the series fitted again with it.
"""

from collections.abc import Callable, Sequence

import numpy as np

from matcal.fitting.relaxation.hold_table import HoldTable
from matcal.fitting.relaxation.prony_search import LEAST_RATIO, residual, search_series, series_at
from matcal.laws.prony import Prony
from matcal.statistics.central_differences import slopes
from matcal.statistics.residual_correlation import Errors, propagated
from touchcal.arrays import Array

# times of the further term over the length of the hold, and how many times the slowest fitted time a hold must last to
# leave room for it: the times of a series are as far from each other as that
_TIMES, _ROOM = (1.0, 3.0), 3.0
MATERIAL = 0.03  # relative change of the long-term modulus from which on it is not determined


def further_term(tables: Sequence[HoldTable], doubts: Sequence[Array], errors: Sequence[Errors], vector: Array,
                 bounds_s: tuple[float, float], hold_s: float) -> Prony | None:
    """The series with one more term, one standard deviation of its share above none, that moves the long-term modulus
    most; None where the slowest fitted one leaves no room for it within the hold."""
    terms = vector.size // 2
    slowest, now = float(np.exp(np.sum(vector[:terms]))), series_at(vector).g_infinity
    found = [_one_more(tables, doubts, errors, vector, bounds_s, times * hold_s) for times in _TIMES
             if hold_s > _ROOM * slowest]
    return max(found, key=lambda series: abs(series.g_infinity - now), default=None)


def _one_more(tables: Sequence[HoldTable], doubts: Sequence[Array], errors: Sequence[Errors], vector: Array,
              bounds_s: tuple[float, float], tau_s: float) -> Prony:
    terms = vector.size // 2
    last = float(np.log(tau_s))
    first = np.r_[vector[:terms], last - np.sum(vector[:terms]), vector[terms:], 0.01]
    at = search_series(tables, first, bounds_s, last)[1]
    # every number but the last time, which the last ratio keeps in place
    moves = np.delete(np.eye(at.size), terms, axis=0)
    moves[:terms, terms] = -1.0
    covariance = moves.T @ covariance_of(tables, doubts, errors, at, moves) @ moves
    best, variance = float(at[-1]), float(covariance[-1, -1])
    if variance <= 0:
        return series_at(at)
    moved = at + covariance[:, -1] / variance * (np.hypot(best, np.sqrt(variance)) - best)
    return series_at(_ordered(moved, float(np.log(bounds_s[0]))))


def _ordered(vector: Array, first: float) -> Array:
    """A vector whose ln times begin at `first` or later and rise by the least ratio at least, with shares that are not
    negative."""
    terms = vector.size // 2
    ln_tau = np.cumsum(vector[:terms])
    rise = np.log(LEAST_RATIO) * np.arange(terms)
    ln_tau = np.maximum.accumulate(np.r_[max(ln_tau[0], first), ln_tau[1:]] - rise) + rise
    return np.r_[np.diff(ln_tau, prepend=0.0), np.maximum(vector[terms:], 0.0)]


def covariance_of(tables: Sequence[HoldTable], doubts: Sequence[Array], errors: Sequence[Errors], vector: Array,
                  moves: Array | None = None) -> Array:
    """(K, K) covariance of the vector of a series along `moves` (K, 2 M), all of it without: correlated noise and
    misfit, contact point and load drift."""
    moves = np.eye(vector.size) if moves is None else moves
    jacobian = slopes(_along(tables, vector, moves), np.zeros(len(moves)))
    free = np.linalg.norm(jacobian, axis=0) > 0
    inverse = np.linalg.pinv(jacobian[:, free], rcond=1e-12)
    ends = np.cumsum([t.rest.shape[0] for t in tables])[:-1]
    gains = [part @ t.basis.T for part, t in zip(np.split(inverse, ends, axis=1), tables, strict=True)]
    covariance = propagated(errors, np.hstack(gains))
    for gain, doubt in zip(gains, doubts, strict=True):
        covariance = covariance + (gain @ doubt) @ (gain @ doubt).T
    out = np.zeros((len(moves), len(moves)))
    out[np.ix_(free, free)] = covariance
    return out


def _along(tables: Sequence[HoldTable], vector: Array, moves: Array) -> Callable[[Array], Array]:
    return lambda way: residual(tables, vector + way @ moves)
