"""Intervals of nu fitted term by term: how far each may go before the fit, everything else free, is worse by too much.

One term's nu trades against another's along curved valleys, where slopes at their bottom say little.
Source: Venzon & Moolgavkar, J. R. Stat. Soc. C 37 (1988) 87, DOI 10.2307/2347496 (profile likelihood intervals).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from matcal.fitting.hyperfoam.exponent_search import allowed_exponents
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.hyperfoam.poisson import NU_BOUNDS
from matcal.fitting.uncertainty import linear_response
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# first step of a walk, halvings once it has gone too far, evaluations of one search, residual of what is no material
_STEP, _HALVINGS, _MOST_CALLS, _REJECTED = 0.02, 4, 30, 10.0
# (law, nu_i) -> (cost, best law with that nu_i, searched from the law)
_Search = Callable[[Hyperfoam, float], tuple[float, Hyperfoam]]


def ends_of(fit: Fit, term: int, most: float) -> tuple[float, float]:
    """Least and largest nu of a term at which the cost, everything else free, stays within `most` of the fit's."""
    least = float(np.sum(np.concatenate(linear_response.misses(fit)) ** 2))
    low, high = (_walked(_search(fit, term), fit.law, term, least + most, way) for way in (-1, 1))
    return low, high


def _walked(search: _Search, law: Hyperfoam, term: int, most: float, way: int) -> float:
    """The nu of a term where the cost reaches `most`, or the bound of its range: doubled steps, then halved ones."""
    bound, at, step = NU_BOUNDS[(way + 1) // 2], float(law.nu[term]), _STEP
    while (nu := float(np.clip(at + way * step, *NU_BOUNDS))) != at:
        cost, found = search(law, nu)
        if cost > most:
            break
        law, at, step = found, nu, 2 * step
    if at == bound:
        return bound
    far = float(np.clip(at + way * step, *NU_BOUNDS))
    for _ in range(_HALVINGS):
        middle = (at + far) / 2
        cost, found = search(law, middle)
        law, at, far = (found, middle, far) if cost <= most else (law, at, middle)
    return (at + far) / 2


def _search(fit: Fit, term: int) -> _Search:
    n, unit = fit.law.alpha.size, fit.law.mu_0_Pa
    allowed = allowed_exponents(fit.curves, float(fit.law.nu.mean()))
    others = np.flatnonzero(np.arange(n) != term)
    lowest = np.r_[np.full(n, -np.inf), np.full(n, allowed.low), np.full(n - 1, NU_BOUNDS[0])]
    highest = np.r_[np.full(n, np.inf), np.full(n, allowed.high), np.full(n - 1, NU_BOUNDS[1])]
    worst = np.full(linear_response.rows_of(fit), _REJECTED)

    def search(law: Hyperfoam, nu: float) -> tuple[float, Hyperfoam]:
        def made(point: Array) -> Hyperfoam:
            own = np.full(n, nu)
            own[others] = point[2 * n:]
            return replace(law, mu_Pa=unit * point[:n], alpha=point[n:2 * n], nu=own)

        def residual(point: Array) -> Array:
            try:
                return np.concatenate(linear_response.misses(replace(fit, law=made(point))))
            except (ValueError, NotConverged):
                return worst

        start = np.clip(np.r_[law.mu_Pa / unit, law.alpha, law.nu[others]], lowest + 1e-9, highest - 1e-9)
        out: Any = least_squares(residual, start, bounds=(lowest, highest), x_scale="jac", max_nfev=_MOST_CALLS)
        cost = 2 * float(out.cost)
        return cost, made(out.x) if cost < _REJECTED else law

    return search
