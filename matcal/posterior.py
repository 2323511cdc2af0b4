"""Posterior of a fitted law: emcee on the exponents alone, with moduli and nuisances marginalised exactly.

For given exponents alpha and noise sigma the weighted stress is linear in the moduli and in the nuisances z (contact
points, load drifts, Prony series): y = A(alpha) mu + V z + noise, mu ~ N(0, (100 mu_0)^2), z ~ N(mean, 1). Both
integrate in closed form, which leaves N + 1 numbers to sample instead of 2 N + J, and none of them is nearly dependent
on another. Exponents are uniform within bounds, ordered, at least a gap apart; ln sigma is flat.

The likelihood counts as many points as the fit's residuals are worth: misfit leaves correlated residuals, and taking
those for independent noise would make intervals too short. What the order of the law hides is not in here; it is in
`matcal.uncertainty`. Source: Foreman-Mackey et al. 2013, DOI 10.1086/670067 (emcee); ter Braak & Vrugt 2008,
DOI 10.1007/s11222-008-9104-9 (differential evolution with snooker moves).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import emcee
import numpy as np
from numpy.typing import NDArray

from matcal.conductivity_fit import ConductivityFit, conductivity_draws
from matcal.draws import Draws
from matcal.errors import NotConverged
from matcal.fit import Fit, allowed_exponents
from matcal.linear_response import PRIOR_MODULI
from matcal.nuisance import Nuisance, nuisance
from matcal.prony import Prony
from matcal.relaxation_fit import PronyFit
from matcal.tabulated import Table, tabulate
from matcal.uncertainty import Uncertainty
from matcal.varpro import Exponents

Array = NDArray[np.float64]

# walkers in each ensemble, spread of the start in the exponents of each, steps between checks, draws kept
_WALKERS, _SPREADS, _CHUNK, _KEPT = 24, (0.03, 0.3), 1000, 1000
# most steps of a run
MOST_STEPS = 8000
# gate: largest R-hat, least effective sample size, least number of autocorrelation times
RHAT, ESS, TIMES = 1.01, 1000.0, 50.0


@dataclass(frozen=True)
class Posterior:
    """Draws of whole parameter sets and how far they can be trusted."""

    # parameter sets
    draws: Draws
    # rhat, ess, autocorrelation_steps, steps, acceptance, effective_points, converged, cpu_s
    checks: dict[str, float | bool]
    # the prior in words
    prior: str


@dataclass(frozen=True)
class _Problem:
    """Everything that one evaluation needs, moduli in units of mu_0."""

    # design on a short basis
    table: Table
    # (r, J) nuisance effects on that basis
    effect: Array
    # (J,) prior means of the nuisances
    mean: Array
    # exponents within the prior
    allowed: Exponents
    # number of exponents
    order: int
    # unit of the moduli, Pa
    mu_0_Pa: float
    # independent points that the residuals are worth
    points: float


def sample(fit: Fit, uncertainty: Uncertainty, prony: PronyFit | None, skin: ConductivityFit | None,
           seed: int, advance: Callable[[int], None] = lambda done: None) -> Posterior:
    """Draws from the posterior of law, series and skin; NotConverged carries them where the checks fail.

    `advance` is told the number of steps done, of MOST_STEPS at most.
    """
    start = time.process_time()
    known = nuisance(fit, prony)
    problem = _problem(fit, known, uncertainty.effective_points)
    chains, checks = _run(problem, fit, seed, advance)
    rng = np.random.default_rng([seed, 1])
    pick = np.linspace(0, chains.shape[0] * chains.shape[1] - 1, _KEPT).astype(int)
    alpha, mu, z = _moduli(problem, chains.reshape(-1, problem.order + 1)[pick], rng)
    g, tau = _series_draws(prony, known, z) if prony is not None else (None, None)
    draws = Draws(mu, alpha, float(fit.law.nu[0]), g, tau,
                  None if skin is None else conductivity_draws(skin, _KEPT, rng))
    checks |= {"effective_points": problem.points, "cpu_s": time.process_time() - start}
    found = Posterior(draws, checks, _prior_words(problem))
    if not checks["converged"]:
        raise NotConverged(
            f"posterior: after {checks['steps']:.0f} steps R-hat is {checks['rhat']:.3f} (wanted below {RHAT}), the "
            f"effective sample size {checks['ess']:.0f} (wanted {ESS:.0f}) and the chain "
            f"{checks['steps_kept'] / checks['autocorrelation_steps']:.0f} autocorrelation times long (wanted "
            f"{TIMES:.0f}). Give a lower --order, or more data; the draws so far are in the card's folder.",
            estimate=found)
    return found


def _problem(fit: Fit, known: Nuisance, points: float) -> _Problem:
    allowed = allowed_exponents(fit.curves)
    table = tabulate(fit.curves, float(fit.law.nu[0]), (allowed.low, allowed.high), known.effect)
    return _Problem(table, table.basis.T @ known.effect, known.mean, allowed, fit.law.alpha.size, fit.law.mu_0_Pa,
                    points)


def _log_probability(problem: _Problem, points: Array) -> Array:
    """Log posterior density, (W,), at (alpha..., ln sigma) (W, N + 1), moduli and nuisances integrated out."""
    alpha = points[:, :-1]
    inside = (alpha[:, 0] > problem.allowed.low) & (alpha[:, -1] < problem.allowed.high)
    inside &= np.all(np.diff(alpha, axis=1) >= problem.allowed.gap, axis=1) & (np.abs(points[:, -1]) < 20)
    out = np.full(points.shape[0], -np.inf)
    if inside.any():
        r = np.abs(np.einsum("wkk->wk", _triangles(problem, points[inside])))
        out[inside] = -problem.points * points[inside, -1] - 0.5 * r[:, -1] ** 2 - np.log(r[:, :-1]).sum(axis=1)
    return out


def _triangles(problem: _Problem, points: Array) -> Array:
    """(W, K + 1, K + 1) triangular factors of [weighted design, nuisances | target] with the prior as further rows."""
    walkers, order, numbers = points.shape[0], problem.order, problem.mean.size
    sd = np.exp(points[:, -1])[:, None, None] / np.sqrt(problem.points)
    columns = problem.table.column(points[:, :-1].ravel()).reshape(walkers, order, -1).transpose(0, 2, 1)
    rows = columns.shape[1]
    width = order + numbers
    system = np.zeros((walkers, rows + width, width + 1))
    system[:, :rows, :order] = columns * problem.mu_0_Pa / sd
    system[:, :rows, order:width] = problem.effect / sd
    system[:, :rows, width] = problem.table.target / sd[..., 0]
    prior = np.r_[np.full(order, 1 / PRIOR_MODULI), np.ones(numbers)]
    system[:, rows + np.arange(width), np.arange(width)] = prior
    system[:, rows + order:, width] = problem.mean
    return np.asarray(np.linalg.qr(system, mode="r"), dtype=float)


def _moduli(problem: _Problem, points: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Exponents, moduli (Pa) and nuisances drawn given each sampled point: (D, N), (D, N), (D, J)."""
    r = _triangles(problem, points)
    width = r.shape[1] - 1
    noise = rng.normal(size=(points.shape[0], width))
    solved = np.linalg.solve(r[:, :width, :width], (r[:, :width, width] + noise)[..., None])[..., 0]
    solved = np.asarray(solved, dtype=float)
    return points[:, :-1], solved[:, :problem.order] * problem.mu_0_Pa, solved[:, problem.order:]


def _run(problem: _Problem, fit: Fit, seed: int,
         advance: Callable[[int], None]) -> tuple[Array, dict[str, float | bool]]:
    """Chains (steps, walkers of all ensembles, N + 1) after burn-in, and their checks."""
    rng = np.random.default_rng([seed, 0])
    size = problem.order + 1
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    samplers = [emcee.EnsembleSampler(_WALKERS, size, lambda p: _log_probability(problem, p), vectorize=True,
                                      moves=moves) for _ in _SPREADS]
    states = [emcee.State(_start(problem, fit, width, rng), random_state=_legacy_state(rng)) for width in _SPREADS]
    steps, checks = 0, {"converged": False}
    chains = np.empty((0, 0, size))
    while steps < MOST_STEPS and not checks["converged"]:
        states = [s.run_mcmc(state, _CHUNK, skip_initial_state_check=True)
                  for s, state in zip(samplers, states, strict=True)]
        steps += _CHUNK
        advance(steps)
        chains = np.concatenate([np.asarray(s.get_chain(discard=steps // 4)) for s in samplers], axis=1)
        checks = _checks(chains)
    acceptance = float(np.mean([s.acceptance_fraction.mean() for s in samplers]))
    return chains, checks | {"steps": float(steps), "steps_kept": float(chains.shape[0]), "acceptance": acceptance}


def _start(problem: _Problem, fit: Fit, width: float, rng: np.random.Generator) -> Array:
    """Walkers spread about the fit by `width` in the exponents, all of them inside the prior."""
    centre = np.r_[fit.law.alpha + 0.01 * np.arange(problem.order), 0.5 * np.log(fit.optimum.cost)]
    out: list[Array] = []
    while len(out) < _WALKERS:
        trial = centre + width * rng.normal(size=(4 * _WALKERS, centre.size))
        trial[:, :-1].sort(axis=1)
        out += list(trial[np.isfinite(_log_probability(problem, trial))])
    return np.array(out[:_WALKERS])


def _legacy_state(rng: np.random.Generator):
    """State of the generator type that emcee draws from, seeded from ours."""
    return np.random.RandomState(int(rng.integers(2**32))).get_state()


def _checks(chains: Array) -> dict[str, float | bool]:
    """Largest R-hat, least effective sample size and longest autocorrelation time over all coordinates."""
    import arviz

    data = arviz.convert_to_dataset({"x": np.moveaxis(chains, 1, 0)})
    rhat = float(np.max(np.asarray(arviz.rhat(data)["x"])))  # pyright: ignore[reportIndexIssue]
    steps = float(np.max(emcee.autocorr.integrated_time(chains, tol=0, has_walkers=True)))
    ess = chains.shape[0] * chains.shape[1] / steps
    return {"rhat": rhat, "ess": ess, "autocorrelation_steps": steps,
            "converged": rhat < RHAT and ess > ESS and chains.shape[0] > TIMES * steps}


def _series_draws(prony: PronyFit, known: Nuisance, z: Array) -> tuple[Array, Array]:
    """(D, M) g and tau_s moved by their nuisances; tau by its logarithm, g kept at or above 0 with a sum below 1."""
    assert known.series is not None
    terms = prony.prony.g.size
    step = z[:, known.mean.size - known.series.shape[1]:] @ known.series.T
    return series_of(prony.prony, step[:, :terms], step[:, terms:])


def series_of(prony: Prony, g_step: Array, tau_step: Array) -> tuple[Array, Array]:
    """(D, M) g and tau_s at steps (D, M) from a series, inside what a series may be, in order of tau."""
    g = np.maximum(prony.g + g_step, 0.0)
    g = g * np.minimum(1.0, 0.999 / np.maximum(g.sum(axis=1, keepdims=True), 1e-300))
    tau = prony.tau_s * np.exp(tau_step / prony.tau_s)
    order = np.argsort(tau, axis=1)
    return np.take_along_axis(g, order, axis=1), np.take_along_axis(tau, order, axis=1)


def _prior_words(problem: _Problem) -> str:
    allowed = problem.allowed
    return (f"alpha uniform between {allowed.low:.3g} and {allowed.high:.3g}, in order, {allowed.gap:.2g} apart; mu_i "
            f"normal about 0 with {PRIOR_MODULI:g} mu_0; ln sigma flat; contact points, drifts and series normal with "
            f"their own errors; {problem.points:.0f} effective points.")
