"""Intervals of what a fit really measures, honest where residuals are correlated and the record itself is uncertain.

Parameters and nuisances (contact points, Prony series) move together with the data, d(theta, z) = A db. The covariance
A C A' is built from what the data can do (a "sandwich"): each curve's own residual variance times the autocorrelation
time of its residuals, so that misfit counts as few effective points and not as many. What the order of the law hides
is seen by adding one term: the difference enters as one more standard deviation. Left out: scatter from specimen to
specimen, errors in the specimen's size, drift of the load zero within a test.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from matcal.fit import Fit
from matcal.hyperfoam import Hyperfoam
from matcal.linear_response import free_directions, free_slopes, joint_gain, prior_precision, spread_of
from matcal.modes import nominal_stress
from matcal.nuisance import nuisance
from matcal.relaxation_fit import PronyFit

Array = NDArray[np.float64]

# compression at which the plateau stress is read (CV40 of ISO 3386-1)
PLATEAU_STRAIN = -0.4


@dataclass(frozen=True)
class Interval:
    """A number with its 95 % interval."""

    # best estimate
    value: float
    # standard deviation, of which `form` comes from the order of the law
    sd: float
    form: float
    # ends of the interval
    lo: float
    hi: float


@dataclass(frozen=True)
class Uncertainty:
    """Linearised uncertainty of a fit."""

    # derived quantity -> interval; units in the names
    derived: dict[str, Interval]
    # (2 N, 2 N) covariance of (mu_Pa, alpha)
    covariance: Array
    # independent points of one common noise level that would know mu_0 as well as these curves do
    effective_points: float


def derived_quantities(law: Hyperfoam) -> dict[str, float]:
    """mu_0_Pa, E_0_Pa and plateau_Pa, the compression stress at 40 % (CV40 of ISO 3386-1), Pa."""
    return {"mu_0_Pa": law.mu_0_Pa, "E_0_Pa": law.E_0_Pa,
            "plateau_Pa": -float(nominal_stress(law, "uniaxial", PLATEAU_STRAIN))}


def linearised(fit: Fit, prony: PronyFit | None = None) -> Uncertainty:
    """Intervals of derived quantities and covariance of (mu, alpha) about the fit."""
    covariance, gain = _covariance(fit, prony)
    spread, gradients, value = spread_of(fit), _gradients(fit.law), derived_quantities(fit.law)
    wider = derived_quantities(fit.wider) if fit.wider is not None else value
    quantile = float(student.ppf(0.975, max(1.0, spread.points - 2 * fit.law.alpha.size)))
    derived = {}
    for name, gradient in gradients.items():
        form = abs(wider[name] - value[name])
        sd = float(np.hypot(np.sqrt(gradient @ covariance @ gradient), form))
        derived[name] = Interval(value[name], sd, form, value[name] - quantile * sd, value[name] + quantile * sd)
    own = gradients["mu_0_Pa"] @ gain
    return Uncertainty(derived, covariance, fit.optimum.cost * float(own @ own) / float(own @ (spread.variance * own)))


def _covariance(fit: Fit, prony: PronyFit | None) -> tuple[Array, Array]:
    """Covariance of (mu, alpha), and their gain (2 N, n) on the weighted data."""
    known, spread, free = nuisance(fit, prony), spread_of(fit).variance, free_directions(fit)
    variance = float(np.mean(spread))
    gain = joint_gain(free_slopes(fit), known.effect, variance, prior_precision(fit))[:free.shape[1]]
    data, prior = free @ gain[:, :spread.size], free @ gain[:, spread.size:]
    return data @ (spread[:, None] * data.T) + variance * prior @ prior.T, data


def _gradients(law: Hyperfoam) -> dict[str, Array]:
    """Derived quantity -> (2 N,) slope in (mu, alpha)."""
    n = law.mu_Pa.size
    scale = np.r_[np.full(n, 1e-4 * law.mu_0_Pa), np.full(n, 1e-5)]

    def at(shift: Array) -> dict[str, float]:
        return derived_quantities(replace(law, mu_Pa=law.mu_Pa + shift[:n], alpha=law.alpha + shift[n:]))

    ends = [(at(row), at(-row)) for row in np.diag(scale)]
    return {name: np.array([(high[name] - low[name]) / (2 * s) for (high, low), s in zip(ends, scale, strict=True)])
            for name in derived_quantities(law)}
