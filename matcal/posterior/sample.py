"""Joint posterior of a calibration by emcee, on few numbers: exponents, noise, series; the rest integrated exactly.

Sampled together are, where they were fitted: exponents and noise of a hyperfoam, a shared nu, the scatter between
specimens (`matcal.posterior.hyperfoam_posterior`) or the parameters of any other law
(`matcal.posterior.general_posterior`), ln tau, g and noise of the series (`matcal.posterior.prony_posterior`). What is
linear, nuisances and the moduli of a hyperfoam, is drawn given those, so that one draw is one whole card: its law is
the one that its series' rate correction asks for. The skin shares nothing with the foam and is drawn separately
(`matcal.posterior.conductivity_posterior`).

The likelihood counts as many points as the fit's residuals are worth: misfit leaves correlated residuals, and taking
those for independent noise would make intervals too short. What the order of the law hides is not in here; it is in
`matcal.fitting.uncertainty.intervals`.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from matcal.fitting.conductivity_fit import ConductivityFit
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.fitting.uncertainty.intervals import Uncertainty
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior import conductivity_posterior, general_posterior, hyperfoam_posterior, prony_posterior
from matcal.posterior.derived_quantities import watched
from matcal.posterior.drawn_laws import moduli_of
from matcal.posterior.draws import Draws
from matcal.posterior.ensembles import ESS, RHAT, Chains, gate_words, run_ensembles
from matcal.posterior.prony_posterior import SeriesPart
from touchcal.arrays import Array
from touchcal.errors import NotConverged

_KEPT = 1000  # draws kept
_SERIES_SPREAD = (0.3, 0.03, 0.2)  # of the widest start in ln tau, over g, in ln noise


class LawPart(Protocol):
    """The law's part of the posterior: some numbers sampled, the rest integrated out."""

    @property
    def size(self) -> int: ...  # sampled numbers

    @property
    def effective_sample_size(self) -> float: ...  # independent points of the residuals

    @property
    def decisions(self) -> tuple[str, ...]: ...  # what was assumed, one sentence each

    @property
    def prior(self) -> str: ...  # in words

    @property
    def remedy(self) -> str: ...  # what may help chains that do not converge; empty where nothing is known

    def log_density(self, x: Array, ln_tau: Array | None, g: Array | None, share: float = 1.0) -> Array:
        """(W,) log density at (W, size), for series with (W, M) ln_tau and g; `share` of the points is counted."""
        ...

    def draws(self, x: Array, ln_tau: Array | None, g: Array | None, rng: np.random.Generator) -> Draws:
        """Laws at sampled points (W, size)."""
        ...

    def start(self, fit: Fit) -> tuple[Array, Array]:
        """(size,) the fit in the coordinates that are sampled, and the widest spread of starts about it."""
        ...


@dataclass(frozen=True)
class Posterior:
    """Draws of whole parameter sets and how far they can be trusted."""

    draws: Draws  # parameter sets
    # rhat, ess, autocorrelation_steps, steps, steps_kept, acceptance, effective_points, converged, cpu_s
    checks: dict[str, float | bool]
    prior: str  # the prior in words
    quantities: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # derived quantity -> {rhat, ess}
    decisions: tuple[str, ...] = ()  # what was assumed about specimens, one sentence each
    log_density: Array | None = None  # (D,) log density of each draw in the sampled numbers; None without any
    seed: int = 0  # seed of everything


@dataclass(frozen=True)
class _Joint:
    law: LawPart | None
    series: SeriesPart | None

    def split(self, x: Array) -> tuple[Array, Array]:
        size = self.law.size if self.law else 0
        return x[:, :size], x[:, size:]

    def series_of(self, x: Array) -> tuple[Array | None, Array | None]:
        if self.series is None:
            return None, None
        y, m = self.split(x)[1], self.series.terms
        return y[:, :m], y[:, m:2 * m]

    def log_density(self, x: Array, share: float = 1.0) -> Array:
        """(W,) log density of all parts, `share` of the points counted."""
        out = np.zeros(x.shape[0])
        law, series = self.split(x)
        if self.series is not None:
            out = prony_posterior.log_series(self.series, series, share)
        good = np.isfinite(out)
        if self.law is not None and good.any():
            ln_tau, g = self.series_of(x[good])
            out[good] += self.law.log_density(law[good], ln_tau, g, share)
        return out


def sample(fit: Fit | None, uncertainty: Uncertainty | None, prony: PronyFit | None, skin: ConductivityFit | None,
           seed: int, advance: Callable[[int], None] = lambda done: None) -> Posterior:
    """Draws from the posterior of law, series and skin, those that there are; NotConverged carries them where the
    checks fail. `advance` gets the number of steps done, of MOST_STEPS at most. Raises ValueError where there is
    nothing to sample, or for unequal nu."""
    start = time.process_time()
    rng = np.random.default_rng([seed, 1])
    relaxing = prony if prony is not None and np.any(prony.prony.g) else None
    joint = _Joint(_law_part(fit, uncertainty, relaxing) if fit is not None and uncertainty is not None else None,
                   prony_posterior.series_part(relaxing) if relaxing is not None else None)
    if joint.law is None and joint.series is None and skin is None:
        raise ValueError("`posterior` has nothing to sample: give a stress-strain, relaxation or conductivity file; a "
                         "stress that does not relax has no series to sample.")
    chains = _run(joint, fit, relaxing, seed, advance) if joint.law or joint.series else None
    along = conductivity_posterior.skin_chains(skin, 2 * _KEPT, rng) if skin is not None else None
    coated = along.transpose(1, 0, 2).reshape(-1, along.shape[-1])[::2][:_KEPT] if along is not None else None
    x = chains.spread_out(2 * _KEPT) if chains is not None else np.empty((_KEPT, 0))
    draws, x = _whole(_draws(joint, x, rng), x, coated)
    checks = _checks(chains, skin, along) | {"cpu_s": time.process_time() - start}
    if joint.law is not None:
        checks["effective_points"] = joint.law.effective_sample_size
    found = Posterior(draws, checks, _prior(joint, skin), chains.quantities if chains else {},
                      joint.law.decisions if joint.law else (), joint.log_density(x) if chains else None, seed)
    if not checks["converged"]:
        raise NotConverged(f"posterior: {gate_words(checks)}. {_remedy(joint)} The draws so far are in the card's "
                           "folder, marked as not converged.", estimate=found)
    return found


def _law_part(fit: Fit, about: Uncertainty, prony: PronyFit | None) -> LawPart:
    """The moduli of a hyperfoam are integrated out; any other law is sampled whole."""
    if isinstance(fit.law, Hyperfoam):
        return hyperfoam_posterior.law_part(fit, about.effective_points, prony, (*about.ridges, None)[0])
    return general_posterior.law_part(fit, about.effective_points, prony)


def _whole(draws: Draws, x: Array, coated: Array | None) -> tuple[Draws, Array]:
    """_KEPT draws evenly among those whose mu_0 is positive, as the prior asks, and their points."""
    good = np.flatnonzero(moduli_of(draws)[0] > 0) if draws.law else np.arange(x.shape[0])
    if good.size < _KEPT:
        good = np.resize(good, _KEPT)
    pick = good[np.linspace(0, good.size - 1, _KEPT).astype(int)]
    return replace(draws.taken(pick), conductivity_S_per_m=coated), x[pick]


def _run(joint: _Joint, fit: Fit | None, prony: PronyFit | None, seed: int, advance: Callable[[int], None]) -> Chains:
    rng = np.random.default_rng([seed, 2])
    starts = []
    if joint.law is not None and fit is not None:
        starts.append(joint.law.start(fit))
    if joint.series is not None and prony is not None:
        starts.append((prony_posterior.start_series(joint.series, prony),
                       np.repeat(_SERIES_SPREAD, [joint.series.terms, joint.series.terms, 1])))
    centre, scale = (np.concatenate(part) for part in zip(*starts, strict=True))
    ranges = dict(fit.law.strain_range) if fit is not None else {}
    return run_ensembles(joint.log_density, centre, scale, lambda x: watched(_draws(joint, x, rng), ranges), seed,
                         advance)


def _draws(joint: _Joint, x: Array, rng: np.random.Generator) -> Draws:
    """Whole parameter sets at sampled points (D, size)."""
    ln_tau, g = joint.series_of(x)
    drawn = Draws({}) if joint.law is None else joint.law.draws(joint.split(x)[0], ln_tau, g, rng)
    return drawn if ln_tau is None else replace(drawn, g=g, tau_s=np.exp(ln_tau))


def _checks(chains: Chains | None, skin: ConductivityFit | None, along: Array | None) -> dict[str, float | bool]:
    """The gate of the foam's chains and of the skin's together."""
    checks: dict[str, float | bool] = dict(chains.checks) if chains is not None else {}
    if skin is None or along is None:
        return checks
    own = conductivity_posterior.skin_checks(skin, along)
    passed = own["rhat"] <= RHAT and own["ess"] >= ESS
    if not checks:
        return {**own, "steps": own["steps_kept"], "converged": passed}
    passed = bool(checks["converged"]) and passed
    return checks | {"converged": passed, "skin_rhat": own["rhat"], "skin_ess": own["ess"]}


def _prior(joint: _Joint, skin: ConductivityFit | None) -> str:
    parts = ([joint.law.prior] if joint.law else []) + (
        [prony_posterior.prior_words(joint.series)] if joint.series else []) + (
        [conductivity_posterior.prior_words(skin)] if skin is not None else [])
    return "; ".join(parts) + "."


def _remedy(joint: _Joint) -> str:
    if joint.law is not None and joint.law.remedy:
        return joint.law.remedy
    if joint.series is not None and joint.series.terms > 1:
        return f"Give --prony-terms {joint.series.terms - 1}, or a longer hold."
    return "Give more data."
