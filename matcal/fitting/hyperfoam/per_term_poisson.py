"""The law when terms differ in nu: moduli, exponents and ratios at once by nonlinear least squares.

The lateral stretch then follows from the balance of all terms, so stress is no longer linear in the moduli and variable
projection does not apply. The search starts from laws with one nu, found by variable projection.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from matcal.fitting.hyperfoam.constrained_moduli import bound_rows, least
from matcal.fitting.hyperfoam.curves import Curve, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.poisson import NU_BOUNDS, lateral_residual
from matcal.fitting.hyperfoam.variable_projection import Exponents, exponents
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array
from touchcal.errors import NotConverged

if TYPE_CHECKING:
    from lmfit import Parameters

# residual for a law that is no material or whose free faces find no rest, and per mu_0 that an inequality falls short
_REJECTED, _PENALTY = 10.0, 30.0
# steps of one search, each with two evaluations for every one of 3 N parameters
_MOST_STEPS = 100


@dataclass(frozen=True)
class Refined:
    """A law with unequal nu."""

    law: Hyperfoam  # fitted law
    cost: float  # sum of squared weighted stress residuals
    evaluations: int  # evaluations of the model


def refine(curves: Sequence[Curve], starts: Sequence[Hyperfoam], allowed: Exponents, fit_nu: bool,
           rows: Callable[[Array, Array], Array] | None = None) -> Refined:
    """Least squares of stress and lateral strain over (mu, alpha), and nu where `fit_nu`, from the best of `starts`.
    `rows`(alpha, nu) (m, N): inequalities rows @ mu > 0 held by a penalty (to be checked afterwards). Raises
    NotConverged where no start gives a law whose free faces find a stress-free stretch."""
    from lmfit import minimize

    target, calls = weighted_stress(curves), 0
    lateral = sum(c.experiment.strain.size for c in curves if c.experiment.lateral is not None)
    worst = np.full(target.size + lateral, _REJECTED)

    def residual(point: Parameters, mu_0_Pa: float) -> Array:
        nonlocal calls
        calls += 1
        mu, alpha, nu = _parameters(point, allowed)
        short = _shortfall(mu, alpha, nu, rows)
        try:
            law = Hyperfoam(mu_0_Pa * mu, alpha, nu)
            return np.r_[weighted_model(curves, law) - target, lateral_residual(curves, law), short]
        except (ValueError, NotConverged):
            return np.r_[worst, short]

    found: list[tuple[float, Hyperfoam]] = []
    for start in starts:
        with np.errstate(invalid="ignore"):  # its standard errors, which are not read, where a term is not seen
            out: Any = minimize(residual, _start(start, allowed, fit_nu), "least_squares", (start.mu_0_Pa,),
                                max_nfev=_MOST_STEPS * (6 * start.nu.size + 1), jac="3-point", x_scale="jac",
                                xtol=1e-10, ftol=1e-10, gtol=1e-14)
        if np.any(out.residual[:worst.size] != _REJECTED):
            mu, alpha, nu = _parameters(out.params, allowed)
            found.append((float(out.chisqr), Hyperfoam(start.mu_0_Pa * mu, alpha, nu)))
    if not found:
        raise NotConverged("nu term by term: from no start do the free faces find a stretch without stress. Give one "
                           "nu for all terms, or a lower order.")
    law = min(found, key=lambda pair: pair[0])[1]
    return Refined(law, float(np.sum((weighted_model(curves, law) - target) ** 2)), calls)


def with_nu(law: Hyperfoam, nu: ArrayLike) -> Hyperfoam:
    """The law with other nu."""
    return replace(law, nu=np.asarray(nu, dtype=float))


def _shortfall(mu: Array, alpha: Array, nu: Array, rows: Callable[[Array, Array], Array] | None) -> Array:
    """What mu, in units of mu_0, lack of the inequalities, weighed."""
    held = bound_rows(alpha) @ mu
    if rows is not None:
        stable = rows(alpha, nu)
        held = np.r_[held, stable @ mu - least(stable)]
    return _PENALTY * np.maximum(-held, 0.0)


def _start(law: Hyperfoam, allowed: Exponents, fit_nu: bool) -> Parameters:
    """mu_i in units of mu_0, the steps from one exponent to the next, and nu_i, with their bounds."""
    from lmfit import Parameters

    start = Parameters()
    for k, (mu, step, nu) in enumerate(zip(law.mu_Pa / law.mu_0_Pa, np.diff(law.alpha, prepend=0.0), law.nu,
                                           strict=True)):
        low, high = (allowed.gap, allowed.high - allowed.low) if k else (allowed.low, allowed.high)
        start.add(f"mu_{k}", mu)
        start.add(f"step_{k}", np.clip(step, low + 1e-6, high - 1e-6), min=low, max=high)
        start.add(f"nu_{k}", np.clip(nu, NU_BOUNDS[0] + 1e-6, NU_BOUNDS[1] - 1e-6) if fit_nu else nu, fit_nu,
                  *(NU_BOUNDS if fit_nu else ()))
    return start


def _parameters(point: Parameters, allowed: Exponents) -> tuple[Array, Array, Array]:
    """(mu in units of the start's mu_0, alpha, nu), (N,) each."""
    mu, steps, nu = np.array(list(point.valuesdict().values())).reshape(-1, 3).T
    return mu, exponents(steps, allowed), nu
