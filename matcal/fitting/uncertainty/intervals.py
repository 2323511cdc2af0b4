"""Intervals of what a fit really measures, honest where residuals are correlated and the record itself is uncertain.

Parameters and nuisances (contact points, Prony series) move together with the data, d(theta, z) = A db. The covariance
A C A' is built from what the data can do (a "sandwich"), C being that of each curve's own errors, correlated as its
residuals show (`matcal.statistics.residual_correlation`), so that misfit counts as few effective points and not as
many. What the order of the law hides is seen by adding one term, or by leaving one out where that fits nearly as well:
the larger difference enters as one more standard deviation. A fitted nu is not linearised: see
`matcal.fitting.uncertainty.nu_ridge`; fitted term by term it moves with the moduli, its prior uniform, and its own
intervals are those of profiles (`matcal.fitting.uncertainty.nu_each`). One that was assumed is in no interval of what
was tested; outside the tests `matcal.record.bands` counts it.
Replicates and stated scatter are in it (`matcal.fitting.hyperfoam.specimen_factors`); without either, scatter from
specimen to specimen is left out, as are errors in the specimen's size.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtri, stdtrit

from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.hyperfoam.poisson import AT_BOUND, NU_BOUNDS, PRIOR_NU
from matcal.fitting.hyperfoam.specimen_factors import Specimens, specimens
from matcal.fitting.relaxation.series import Series
from matcal.fitting.uncertainty import linear_response
from matcal.fitting.uncertainty.nu_each import ends_of
from matcal.fitting.uncertainty.nu_ridge import Ridge, mixed, ridges, unit_of_term, with_stated
from matcal.fitting.uncertainty.nuisance import Nuisance, nuisance
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.law import Law, differentiable, units, vector, with_vector
from matcal.statistics.residual_correlation import Errors, propagated
from touchcal.arrays import Array

# least points to spare in Student's law: errors' sizes are averaged already, see `statistics.residual_correlation`
_LEAST_SPARE = 4.0
_LARGE = float(ndtri(0.975))  # standard deviations to either side that hold 95 % where many points are left
# what the intervals are about, said where they are given: of a law with terms, and of one without
OF_ONE_FORM = ("Intervals are of this law: noise and misfit are in them; a toe of the record, or a law of another "
               "kind, is not.")
OF_THIS_LAW = ("Intervals are of this law: noise, misfit and the choice of its order are in them; a toe of the record, "
               "or a law of another kind, is not.")
_WIDE_NU, _NARROW_NU = 0.3, 0.1  # widths of an interval of nu: not determined, and determined even at nu = 0.5
FACTOR = 2.0  # ratio of the ends of an interval from which on a quantity counts as not determined
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
    law: Any  # fitted law
    neighbours: tuple[Law, ...]  # those of the next orders, which show what the order hides
    reach: float  # standard deviations to either side that hold 95 %, by Student's law for few effective points
    shares: Mapping[str, float]  # where the interval of mu_0 comes from, share of its variance
    decisions: tuple[str, ...]  # the largest of them, and what was assumed about specimens, one sentence each
    spare: float = 1e6  # points to spare in Student's law
    ridges: tuple[Ridge, ...] = ()  # profiles of a fitted nu, which then make the intervals; none where it was given
    nu: tuple[Interval, ...] = ()  # of a fitted nu, one for all terms or one a term
    other_nu: Law | None = None  # that of a nu a standard deviation off, where it was assumed; None where it was not

    @property
    def not_determined(self) -> tuple[str, ...]:
        """What the tests leave open: a nu whose interval is wide or reaches a bound of its search, quantities whose
        interval spans more than a factor of `FACTOR`."""
        names = ["nu"] if len(self.nu) == 1 else [f"nu_{k + 1}" for k in range(len(self.nu))]
        return (*(name for name, i in zip(names, self.nu, strict=True) if _left_open(i)),
                *(name for name, i in self.derived.items() if i.hi > FACTOR * i.lo))


def _left_open(nu: Interval) -> bool:
    """Whether an interval of nu is wide, or ends at a bound of the search; a narrow one at the upper bound is that of a
    material that keeps its volume."""
    low, high = NU_BOUNDS
    near = AT_BOUND * (high - low)
    return nu.hi - nu.lo > _WIDE_NU or nu.lo < low + near or (nu.hi > high - near and nu.hi - nu.lo > _NARROW_NU)


def derived_quantities(law: Law) -> dict[str, float]:
    """mu_0_Pa, E_0_Pa and plateau_Pa, the compression stress at 40 % (CV40 of ISO 3386-1), Pa."""
    return {"mu_0_Pa": law.mu_0_Pa, "E_0_Pa": law.E_0_Pa,
            "plateau_Pa": -float(nominal_stress(law, "uniaxial", PLATEAU_STRAIN))}


def plateau_reached(strain_range: Mapping[str, tuple[float, float]]) -> bool:
    """Whether the fitted curves reach the compression at which the plateau stress is read."""
    return strain_range.get("uniaxial", (0.0, 0.0))[0] <= PLATEAU_STRAIN


def measured_quantities(law: Law) -> dict[str, float]:
    """Those of `derived_quantities` that lie within the strains that the law was fitted to."""
    found = derived_quantities(law)
    return found if plateau_reached(law.strain_range) else {n: v for n, v in found.items() if n != "plateau_Pa"}


def linearised(fit: Fit, prony: Series | None = None) -> Uncertainty:
    """Intervals of derived quantities and covariance of (mu, alpha) about the fit."""
    free, differ = _free_directions(fit), specimens(fit.curves, fit.law)
    known = nuisance(fit, prony)
    errors = linear_response.errors_of(fit, _effects(known, differ, _LARGE))
    variance = linear_response.effective_variance(errors)
    n, parameters = sum(e.count for e in errors), len(differentiable(fit.law)) + linear_response.nu_slopes(fit).shape[1]
    spare = max(sum(e.effective_sample_size for e in errors) - parameters, min(_LEAST_SPARE, max(1.0, n - parameters)))
    reach = float(stdtrit(spare, 0.975))
    slopes, terms = linear_response.all_slopes(fit), _nu_effects(fit)
    effect = np.hstack([terms, linear_response.padded(fit, _effects(known, differ, reach))])
    hold = linear_response.prior_precision(fit)[:slopes.shape[1], :slopes.shape[1]]
    gain = linear_response.joint_gain(slopes, effect, variance, hold)[:free.shape[1]]
    data, prior = free @ gain[:, :n], free @ gain[:, n:]
    from_data = propagated(errors, data)
    stated = data @ linear_response.padded(fit, differ.stated)
    covariance = from_data + variance * prior @ prior.T + stated @ stated.T
    over = tuple(with_stated(ridge, stated) for ridge in ridges(fit, effect, errors, spare))
    bare = Uncertainty({}, covariance, _effective_points(fit, data, from_data), fit.law, fit.neighbours, reach, {}, (),
                       spare, over, other_nu=fit.other_nu)
    derived = intervals(bare, measured_quantities)
    mu_0 = _gradients(fit.law, lambda law: {"mu_0_Pa": law.mu_0_Pa}, len(free))["mu_0_Pa"]
    names = [*("nu",) * terms.shape[1], *known.names]
    names += ["scatter between specimens"] * (effect.shape[1] - len(names) + stated.shape[1])
    squares = np.r_[variance * (mu_0 @ prior) ** 2, (mu_0 @ stated) ** 2]
    shares = _shares(derived["mu_0_Pa"], float(mu_0 @ from_data @ mu_0), squares, names, bool(over))
    nu = _nu_intervals(fit, bare, effect[:, terms.shape[1]:], errors)
    found = replace(bare, derived=derived, shares=shares, nu=nu)
    return replace(found, decisions=(*_nu_words(found), _share_sentence(shares), *differ.decisions,
                                     *_limit_sentences(fit)))


def _free_directions(fit: Fit) -> Array:
    """Directions in (mu, alpha), and in nu where that was fitted term by term, that the search was free to take."""
    free = linear_response.free_directions(fit)
    more = fit.law.nu.size if fit.nu_fitted == "fit-each" else 0
    return np.asarray(block_diag(free, PRIOR_NU * np.eye(more)), dtype=float)


def _nu_effects(fit: Fit) -> Array:
    """(n + l, N) effects of nu fitted term by term, each one standard deviation of a uniform nu; else no columns."""
    slopes = linear_response.nu_slopes(fit)
    return PRIOR_NU * slopes if fit.nu_fitted == "fit-each" else slopes[:, :0]


def _nu_intervals(fit: Fit, about: Uncertainty, effect: Array, errors: Sequence[Errors]) -> tuple[Interval, ...]:
    """Of what was fitted of nu, within the bounds of its search: from the ridges, or from the profile of each term."""
    if fit.nu_fitted is None:
        return ()
    if about.ridges:
        (found,) = intervals(about, lambda law: {"nu": float(vector(law)[-1])}).values()
        return (replace(found, lo=max(found.lo, NU_BOUNDS[0]), hi=min(found.hi, NU_BOUNDS[1])),)
    found, variance = replace(fit, law=fit.free or fit.law), linear_response.effective_variance(errors)
    out = []
    for k, value in enumerate(fit.law.nu.tolist()):
        lo, hi = ends_of(found, k, about.reach**2 * unit_of_term(found, k, effect, errors, variance))
        out.append(Interval(value, (hi - lo) / (2 * about.reach), 0.0, min(lo, value), max(hi, value)))
    return tuple(out)


def _nu_words(found: Uncertainty) -> list[str]:
    if not found.nu:
        return []
    each = ", ".join(f"{i.value:.3g} ({i.lo:.3g} to {i.hi:.3g})" for i in found.nu)
    how = ("from the profile of the fit over nu, at this order and the next ones" if found.ridges else
           "from the profile of each; the other intervals are linear in it, nu uniform between its bounds before")
    return [f"nu with its 95 % interval: {each}, {how}; the other intervals include it."]


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


def intervals(about: Uncertainty, quantities: Callable[[Law], Mapping[str, float]]) -> dict[str, Interval]:
    """95 % intervals of any smooth `quantities` of a law: covariance, a fitted nu and hidden order together."""
    value = quantities(about.law)
    if about.ridges:
        spread = mixed(about.ridges, about.law, about.spare,
                       lambda law: (quantities(law), _gradients(law, quantities, 2 * law.alpha.size)))
        return {name: Interval(value[name], s.sd, s.form, s.lo, s.hi) for name, s in spread.items()}
    others = [quantities(law) for law in about.neighbours]
    out = {}
    for name, gradient in _gradients(about.law, quantities, len(about.covariance)).items():
        form = max((abs(other[name] - value[name]) for other in others), default=0.0)
        # slopes of laws with nu near 0.5 have squares that overflow; a power of two rounds nothing
        size = 2.0 ** float(np.frexp(np.abs(gradient).max())[1])
        unit = gradient / size
        sd = float(np.hypot(size * np.sqrt(unit @ about.covariance @ unit), form))
        out[name] = Interval(value[name], sd, form, value[name] - about.reach * sd, value[name] + about.reach * sd)
    return out


def _shares(mu_0: Interval, noise: float, squares: Array, names: Sequence[str], nu_fitted: bool) -> dict[str, float]:
    """Source -> share of the variance of mu_0."""
    out = {"noise and misfit": noise, "the order of the law": mu_0.form**2}
    if nu_fitted:
        out["nu"] = max(mu_0.sd**2 - mu_0.form**2 - noise - float(np.sum(squares)), 0.0)
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
             for g in _gradients(fit.law, measured_quantities, len(gain)).values()]
    least = min(sum(c.experiment.value.size for c in fit.curves), len(differentiable(fit.law)) + _LEAST_SPARE)
    return max(min(sizes), least)


def _gradients(law: Law, quantities: Callable[[Law], Mapping[str, float]], size: int) -> dict[str, Array]:
    """Quantity -> (size,) slope in the first parameters: of a hyperfoam in (mu, alpha), or in (mu, alpha, nu)."""
    sizes = units(law)
    scale = np.where(sizes == 1.0, 1e-5, 1e-4 * sizes)

    def at(shift: Array) -> Mapping[str, float]:
        return quantities(with_vector(law, vector(law) + shift))

    ends = [(at(row), at(-row)) for row in np.diag(scale)[:size]]
    return {name: np.array([(high[name] - low[name]) / (2 * s)
                            for (high, low), s in zip(ends, scale[:size], strict=True)]) for name in quantities(law)}
