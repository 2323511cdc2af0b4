"""Ensembles of emcee run until independent ones agree on everything that is reported.

Several ensembles start from walkers spread differently about the fit and are cooled to the posterior; what counts is
that their draws of the *derived* quantities agree: R-hat between whole ensembles, each split in halves, effective
sample size and the length of the chain in autocorrelation times. Walkers that stay in a mode with a negligible share of
the probability, which cooling may leave behind, are moved out of it, counted, and the chains begun again.

Source: Foreman-Mackey et al. 2013, DOI 10.1086/670067 (emcee); ter Braak & Vrugt 2008, DOI 10.1007/s11222-008-9104-9
(differential evolution with snooker moves); Vehtari et al. 2021, DOI 10.1214/20-BA1221 (rank-normalised split R-hat).
"""

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import emcee
import numpy as np

from touchcal.arrays import Array

Density = Callable[[Array, float], Array]  # (W, size) points and the share of the data that counts -> (W,) log density
Derived = Callable[[Array], Mapping[str, Array]]  # (D, size) points -> quantity -> (D,)

# walkers for each sampled number, at least, and in each ensemble; spread of the start of each ensemble
_PER_NUMBER, _LEAST_WALKERS, _SPREADS = 6, 40, (0.05, 0.4)
_COOLING, _COOLING_STEPS = np.geomspace(0.01, 1.0, 12), 40  # shares of the data while cooling, steps at each
_LOST = 20.0  # log density below which a walker is lost, see `_rescued`
# steps between checks, most steps, most CPU seconds, times of each chain that derived quantities are checked at
CHUNK, MOST_STEPS, MOST_CPU_S, _CHECKED = 1000, 24000, 50.0, 120
RHAT, ESS, TIMES = 1.01, 1000.0, 50.0  # gate: largest R-hat, least effective sample size and autocorrelation times


@dataclass(frozen=True)
class Chains:
    """Draws of the sampled numbers, and whether they may be used."""

    points: Array  # (ensembles, steps, walkers, size) after burn-in
    # rhat, ess, autocorrelation_steps, steps, steps_kept, walkers, ensembles, acceptance, converged
    checks: dict[str, float | bool]
    quantities: dict[str, dict[str, float]]  # quantity -> {rhat, ess}

    def spread_out(self, count: int) -> Array:
        """(count, size) draws evenly over ensembles, steps and walkers."""
        flat = self.points.reshape(-1, self.points.shape[-1])
        return flat[np.linspace(0, flat.shape[0] - 1, count).astype(int)]


def run_ensembles(density: Density, centre: Array, scale: Array, derived: Derived, seed: int,
                  advance: Callable[[int], None] = lambda done: None) -> Chains:
    """Ensembles about `centre` (size,) with starts spread by `scale` (size,) until the gate is passed, or until
    MOST_STEPS or MOST_CPU_S."""
    begun = time.process_time()
    rng = np.random.default_rng([seed, 0])
    walkers = max(_LEAST_WALKERS, _PER_NUMBER * centre.size)
    moves = [(emcee.moves.DEMove(sigma=1e-3), 0.65), (emcee.moves.DEMove(sigma=1e-3, gamma0=1.0), 0.1),
             (emcee.moves.DESnookerMove(), 0.25)]
    samplers = [emcee.EnsembleSampler(walkers, centre.size, lambda x: density(x, 1.0), vectorize=True, moves=moves)
                for _ in _SPREADS]
    states = [emcee.State(_cooled(density, centre, width * scale / _SPREADS[-1], walkers, rng),
                          random_state=_legacy_state(rng)) for width in _SPREADS]
    steps, since, rescued, checks, quantities = 0, 0, 0, {"converged": False}, {}
    points = np.empty((len(_SPREADS), 0, walkers, centre.size))
    while steps < MOST_STEPS and not checks["converged"] and time.process_time() - begun < MOST_CPU_S:
        states = [s.run_mcmc(state, CHUNK, skip_initial_state_check=True)
                  for s, state in zip(samplers, states, strict=True)]
        steps, since = steps + CHUNK, since + CHUNK
        advance(steps)
        points = np.stack([np.asarray(s.get_chain(discard=since // 3)) for s in samplers])
        checks, quantities = _checks(points, derived)
        states, lost = _rescued(states, scale, rng)
        if lost:
            for sampler in samplers:
                sampler.reset()
            checks, since, rescued = checks | {"converged": False}, 0, rescued + lost
    acceptance = float(np.mean([s.acceptance_fraction.mean() for s in samplers]))
    about = {"steps": float(steps), "steps_kept": float(points.shape[1]), "walkers": float(walkers),
             "ensembles": float(len(_SPREADS)), "rescued": float(rescued), "acceptance": acceptance}
    return Chains(points, checks | about, quantities)


def gate_words(checks: Mapping[str, float | bool]) -> str:
    """What a run reached and what was required."""
    lengths = checks["steps_kept"] / max(float(checks["autocorrelation_steps"]), 1e-9)
    return (f"after {checks['steps']:.0f} steps, of which {checks['steps_kept']:.0f} were kept, the worst R-hat is "
            f"{checks['rhat']:.3f} (required at most {RHAT}), the least effective sample size "
            f"{checks['ess']:.0f} (required {ESS:.0f}) and the chain {lengths:.0f} autocorrelation times long "
            f"(required {TIMES:.0f})")


def _cooled(density: Density, centre: Array, scale: Array, walkers: int, rng: np.random.Generator) -> Array:
    """Walkers about the centre, moved and resampled while ever more of the data counts: they find every mode in reach,
    each with its weight."""
    out: list[Array] = []
    width = 1.0
    while len(out) < walkers:
        trial = centre + width * scale * rng.normal(size=(8 * walkers, centre.size))
        out += list(trial[np.isfinite(density(trial, _COOLING[0]))])
        width *= 0.8
    points = np.array(out[:walkers])
    for before, share in zip([_COOLING[0], *_COOLING[:-1]], _COOLING, strict=True):
        points = _resampled(points, density(points, share) - density(points, before), rng)
        sampler = emcee.EnsembleSampler(walkers, centre.size, lambda x, s=share: density(x, s), vectorize=True,
                                        moves=emcee.moves.DEMove(sigma=1e-3))
        state = emcee.State(points, random_state=_legacy_state(rng))
        sampler.run_mcmc(state, _COOLING_STEPS, skip_initial_state_check=True)
        points = np.asarray(sampler.get_chain())[-1]
    separation = points + 1e-4 * scale * rng.normal(size=points.shape)  # snooker moves need different walkers
    return np.where(np.isfinite(density(separation, 1.0))[:, None], separation, points)


def _rescued(states: Sequence[Any], scale: Array, rng: np.random.Generator) -> tuple[list[Any], int]:
    """States with walkers from lost modes put where walkers of the best ensemble are, and how many they were. Lost is a
    log density below that ensemble's median by _LOST and three for each sampled number."""
    densities = [np.asarray(state.log_prob, dtype=float) for state in states]
    best = int(np.argmax([np.median(d) for d in densities]))
    least = float(np.median(densities[best])) - _LOST - 3 * scale.size
    good = np.asarray(states[best].coords)[densities[best] >= least]
    out, total = [], 0
    for state, density in zip(states, densities, strict=True):
        lost = np.flatnonzero(density < least)
        coords = np.array(state.coords)
        separation = 1e-5 * scale * rng.normal(size=(lost.size, scale.size))
        coords[lost] = good[rng.integers(good.shape[0], size=lost.size)] + separation
        total += lost.size
        out.append(state if lost.size == 0 else emcee.State(coords, random_state=state.random_state))
    return out, total


def _resampled(points: Array, log_weight: Array, rng: np.random.Generator) -> Array:
    """As many points, each as often as its weight says (systematic resampling), so that none stays in a lost mode."""
    weight = np.exp(log_weight - log_weight.max())
    at = (np.arange(points.shape[0]) + rng.uniform()) / points.shape[0]
    return points[np.searchsorted(np.cumsum(weight / weight.sum()), at).clip(max=points.shape[0] - 1)]


def _legacy_state(rng: np.random.Generator):
    """State of the generator type that emcee draws from, seeded from ours."""
    return np.random.RandomState(int(rng.integers(2**32))).get_state()


def _checks(points: Array, derived: Derived) -> tuple[dict[str, float | bool], dict[str, dict[str, float]]]:
    """The gate over sampled numbers and derived quantities, and what each quantity reached."""
    import arviz

    ensembles, steps, walkers, size = points.shape
    stride = max(1, steps // _CHECKED)
    picked = points[:, ::stride]
    values = {f"x_{k + 1}": picked[..., k].ravel() for k in range(size)} | dict(derived(picked.reshape(-1, size)))
    quantities = {}
    for name, value in values.items():
        chain = value.reshape(ensembles, -1, walkers)
        data = chain.reshape(ensembles, -1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a constant quantity has no R-hat; it is left out below
            rhat = float(np.asarray(arviz.rhat(data)))  # pyright: ignore[reportArgumentType]
        if np.ptp(data) == 0:
            continue
        lag = max(float(_autocorrelation(chain)), 1.0)
        quantities[name] = {"rhat": rhat, "ess": data.size / lag}
    longest = max(float(np.max(emcee.autocorr.integrated_time(e, tol=0, has_walkers=True))) for e in points)
    rhat, ess = max(q["rhat"] for q in quantities.values()), min(q["ess"] for q in quantities.values())
    passed = bool(rhat <= RHAT and ess >= ESS and steps > TIMES * longest)
    return ({"rhat": rhat, "ess": ess, "autocorrelation_steps": longest, "converged": passed},
            {name: q for name, q in quantities.items() if not name.startswith("x_")})


def _autocorrelation(chain: Array) -> float:
    """Longest integrated autocorrelation time of a quantity over the ensembles (ensembles, steps, walkers)."""
    return max(float(emcee.autocorr.integrated_time(e[..., None], tol=0, has_walkers=True)[0]) for e in chain)
