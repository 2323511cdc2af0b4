"""Intervals of what a fit really measures, honest where residuals are correlated and the record itself is uncertain.

Parameters and nuisances (contact points, Prony series) move together with the data, d(theta, z) = A db. The covariance
A C A' is built from what the data can do (a "sandwich"), C being that of each curve's own errors, correlated as its
residuals show (`matcal.statistics.residual_correlation`), so that misfit counts as few effective points and not as
many. What the order of the law hides is seen by adding one term, or by leaving one out where that fits nearly as well:
the larger difference enters as one more standard deviation.
Replicates and stated scatter are in it (`matcal.fitting.hyperfoam.specimen_factors`); without either, scatter from
specimen to specimen is left out, as are errors in the specimen's size.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from matcal.fitting.hyperfoam import linear_response
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.hyperfoam.specimen_factors import Specimens, specimens
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.fitting.uncertainty.nuisance import Nuisance, nuisance
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array

# least points to spare in Student's law: errors' sizes are averaged already, see `statistics.residual_correlation`
_LEAST_SPARE = 4.0
_LARGE = float(ndtri(0.975))  # standard deviations to either side that hold 95 % where many points are left
# what the intervals are about, said where they are given
OF_THIS_LAW = ("Intervals are of this law: noise, misfit and the choice of its order are in them; a toe of the record, "
               "or a law of another kind, is not.")
PLATEAU_STRAIN = -0.4  # compression at which the plateau stress is read (CV40 of ISO 3386-1)


@dataclass(frozen=True)
class Interval:
    """A number with its 95 % interval."""

    value: float  # best estimate
    sd: float  # standard deviation
    form: float  # the part of it that comes from the order of the law
    lo: float  # ends of the interval
    hi: float


@dataclass(frozen=True)
class Uncertainty:
    """Linearised uncertainty of a fit."""

    derived: dict[str, Interval]  # derived quantity -> interval; units in the names
    covariance: Array  # (2 N, 2 N) covariance of (mu_Pa, alpha)
    # independent points of one common noise level that would know these quantities no better than these curves do
    effective_points: float
    law: Hyperfoam  # fitted law
    neighbours: tuple[Hyperfoam, ...]  # those of the next orders, which show what the order hides
    reach: float  # standard deviations to either side that hold 95 %, by Student's law for few effective points
    shares: Mapping[str, float]  # where the interval of mu_0 comes from, share of its variance
    decisions: tuple[str, ...]  # the largest of them, and what was assumed about specimens, one sentence each


def derived_quantities(law: Hyperfoam) -> dict[str, float]:
    """mu_0_Pa, E_0_Pa and plateau_Pa, the compression stress at 40 % (CV40 of ISO 3386-1), Pa."""
    return {"mu_0_Pa": law.mu_0_Pa, "E_0_Pa": law.E_0_Pa,
            "plateau_Pa": -float(nominal_stress(law, "uniaxial", PLATEAU_STRAIN))}


def plateau_reached(strain_range: Mapping[str, tuple[float, float]]) -> bool:
    """Whether the fitted curves reach the compression at which the plateau stress is read."""
    return strain_range.get("uniaxial", (0.0, 0.0))[0] <= PLATEAU_STRAIN


def measured_quantities(law: Hyperfoam) -> dict[str, float]:
    """Those of `derived_quantities` that lie within the strains that the law was fitted to."""
    found = derived_quantities(law)
    return found if plateau_reached(law.strain_range) else {n: v for n, v in found.items() if n != "plateau_Pa"}


def linearised(fit: Fit, prony: PronyFit | None = None) -> Uncertainty:
    """Intervals of derived quantities and covariance of (mu, alpha) about the fit."""
    free, differ = linear_response.free_directions(fit), specimens(fit.curves, fit.law)
    known = nuisance(fit, prony)
    errors = linear_response.errors_of(fit, _effects(known, differ, _LARGE))
    variance = linear_response.effective_variance(errors)
    n, parameters = sum(e.count for e in errors), 2 * fit.law.alpha.size
    spare = max(sum(e.effective_sample_size for e in errors) - parameters, min(_LEAST_SPARE, max(1.0, n - parameters)))
    reach = float(stdtrit(spare, 0.975))
    effect = _effects(known, differ, reach)
    gain = linear_response.joint_gain(linear_response.free_slopes(fit), effect, variance,
                                      linear_response.prior_precision(fit))[:free.shape[1]]
    data, prior = free @ gain[:, :n], free @ gain[:, n:]
    from_data = linear_response.propagated(errors, data)
    stated = data @ differ.stated
    covariance = from_data + variance * prior @ prior.T + stated @ stated.T
    bare = Uncertainty({}, covariance, _effective_points(fit, data, from_data), fit.law, fit.neighbours, reach, {}, ())
    derived = intervals(bare, measured_quantities)
    mu_0 = np.r_[np.ones(fit.law.mu_Pa.size), np.zeros(fit.law.alpha.size)]
    names = (*known.names, *("scatter between specimens",) * (effect.shape[1] - len(known.names) + stated.shape[1]))
    squares = np.r_[variance * (mu_0 @ prior) ** 2, (mu_0 @ stated) ** 2]
    shares = _shares(derived["mu_0_Pa"], float(mu_0 @ from_data @ mu_0), squares, names)
    return replace(bare, derived=derived, shares=shares, decisions=(_share_sentence(shares), *differ.decisions,
                                                                    *_limit_sentences(fit)))


def _effects(known: Nuisance, differ: Specimens, reach: float) -> Array:
    """(n, J) effects of all that is inferred: nuisances, factors whose interval `reach` times them is."""
    return np.column_stack([known.effect, differ.reach / reach * differ.factor])


def _limit_sentences(fit: Fit) -> list[str]:
    out = []
    if fit.optimum.unbounded is not None:
        out.append("The moduli lie on their bound, where no linearisation holds: the intervals take the fit for one "
                   "that was free and are too short; choose a lower --order, or read those of --posterior.")
    if not plateau_reached(fit.law.strain_range):
        out.append(f"plateau_Pa is left out: no uniaxial test reaches a compression of {-PLATEAU_STRAIN:.0%}.")
    return out


def intervals(about: Uncertainty, quantities: Callable[[Hyperfoam], Mapping[str, float]]) -> dict[str, Interval]:
    """95 % intervals of any smooth `quantities` of a law: covariance and hidden order together."""
    value = quantities(about.law)
    others = [quantities(law) for law in about.neighbours]
    out = {}
    for name, gradient in _gradients(about.law, quantities).items():
        form = max((abs(other[name] - value[name]) for other in others), default=0.0)
        # slopes of laws with nu near 0.5 have squares that overflow; a power of two rounds nothing
        size = 2.0 ** float(np.frexp(np.abs(gradient).max())[1])
        unit = gradient / size
        sd = float(np.hypot(size * np.sqrt(unit @ about.covariance @ unit), form))
        out[name] = Interval(value[name], sd, form, value[name] - about.reach * sd, value[name] + about.reach * sd)
    return out


def _shares(mu_0: Interval, noise: float, squares: Array, names: Sequence[str]) -> dict[str, float]:
    """Source -> share of the variance of mu_0."""
    out = {"noise and misfit": noise, "the order of the law": mu_0.form**2}
    for name, square in zip(names, squares, strict=True):
        out[name] = out.get(name, 0.0) + float(square)
    total = max(sum(out.values()), 1e-300)
    return {name: value / total for name, value in out.items()}


def _share_sentence(shares: Mapping[str, float]) -> str:
    first = sorted(shares, key=lambda name: -shares[name])[:3]
    return ("The interval of mu_0 comes from " + ", ".join(f"{name} ({shares[name]:.0%})" for name in first)
            + " of its variance.")


def _effective_points(fit: Fit, gain: Array, covariance: Array) -> float:
    """Points of one noise level for which the quantity that suffers most from correlation has the same variance; as in
    Student's law, not fewer than the parameters and _LEAST_SPARE, for the errors' sizes are averaged already."""
    sizes = [fit.optimum.cost * float(np.sum((g @ gain) ** 2)) / float(g @ covariance @ g)
             for g in _gradients(fit.law, measured_quantities).values()]
    least = min(sum(c.experiment.value.size for c in fit.curves), 2 * fit.law.alpha.size + _LEAST_SPARE)
    return max(min(sizes), least)


def _gradients(law: Hyperfoam, quantities: Callable[[Hyperfoam], Mapping[str, float]]) -> dict[str, Array]:
    """Quantity -> (2 N,) slope in (mu, alpha)."""
    n = law.mu_Pa.size
    scale = np.r_[np.full(n, 1e-4 * law.mu_0_Pa), np.full(n, 1e-5)]

    def at(shift: Array) -> Mapping[str, float]:
        return quantities(replace(law, mu_Pa=law.mu_Pa + shift[:n], alpha=law.alpha + shift[n:]))

    ends = [(at(row), at(-row)) for row in np.diag(scale)]
    return {name: np.array([(high[name] - low[name]) / (2 * s) for (high, low), s in zip(ends, scale, strict=True)])
            for name in quantities(law)}
