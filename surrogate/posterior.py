"""Posterior of one touch from one frame by emcee: (x, y, d, F) uniform over the training touches' range.

The likelihood is the simulator's: the learned map with a correction, linear in the touch, through scenes solved at
draws of the posterior itself; what those scenes scatter about it counts as noise. Without a simulator it is the learned
map's, its own error counted. Unlike the inversion it takes any diameter for equally likely, known punches or not.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from matcal.chains import run_ensembles
from matcal.errors import NotConverged
from surrogate import emulator, punch_ridge
from surrogate.direct import direct
from surrogate.emulator import Emulator
from surrogate.forward_map import ForwardMap, floor_at, linearise
from surrogate.invert import invert
from surrogate.limit import Prior
from surrogate.loading import to_touch, to_unknown
from surrogate.punch_ridge import Ridge
from surrogate.simulated import Simulator, Unknowns, solved

Array = NDArray[np.float64]

# How far points of the emulator reach, in standard deviations, and beyond the prior, over its ranges.
REACH, MARGIN = 2.0, 0.1
# Draws of the chains that the map itself weighs, the part that must be worth as much as draws of their own, every
# which one is added to the emulator's points where they are not, and rounds.
CHECKED, ENOUGH, ADDED, ROUNDS = 2000, 0.3, 5, 3
# Scenes that the correction is learned from, beside the first, and that test it.
DESIGN, HELD_OUT = 12, 3
# Draws that are kept.
KEPT = 1000
# Touches that the learned map is asked for at once, to bound the memory.
BATCH = 500


@dataclass(frozen=True, eq=False)
class Correction:
    """What is added to the learned map's readings: constant, then by each of the four scaled unknowns."""

    # (4,) middle and scale of the unknowns
    middle: Array
    scale: Array
    # (5, readings) V
    by: Array


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of one touch."""

    # (KEPT, 4) x, y, d in mm, F in N
    draws: Array
    # rhat, ess, autocorrelation_steps, steps, acceptance, converged, as matcal's chains tell them
    checks: dict[str, float | bool]
    # whether the simulator's readings were the likelihood; relative error, 2-norm, of the corrected map at scenes held
    # out of it, NaN without them
    simulated: bool
    held_out: float
    # draws of their own that the weighed ones of the emulator's chains are worth
    effective: float
    # scenes solved, CPU time, s
    simulations: int
    cpu_s: float
    # squared residual, a degree of freedom, at the most probable draw
    misfit: float


@dataclass(frozen=True, eq=False)
class _Frame:
    """What the likelihood is made of."""

    forward: ForwardMap
    signal_V: Array
    prior: Prior
    whiten: Array
    correction: Correction

    def whitened(self, unknown: Array) -> tuple[Array, Array]:
        """Residuals (n, readings) of touches (n, 4), and the slopes (n, readings, 4) of the learned map's part."""
        here = linearise(self.forward, unknown)
        left = here.signal_V + corrected(self.correction, unknown) - self.signal_V
        return left @ self.whiten.T, np.einsum("qr,nrp->nqp", self.whiten, here.jacobian, optimize=True)

    def residual(self, unknown: Array) -> Array:
        """(n, readings) of many touches (n, 4)."""
        return np.concatenate([self.whitened(part)[0] for part in np.array_split(unknown, len(unknown) // BATCH + 1)])

    def allowed(self, unknown: Array, margin: float) -> NDArray[np.bool_]:
        """Which touches (n, 4) are in the prior's range, or beyond it by up to this part."""
        x, y, d, force = to_touch(unknown, self.forward.p0).T
        inside = np.hypot(x, y) <= self.forward.ring.radius_mm * 0.97
        for values, (low, high) in ((d, self.prior.d_mm), (force, self.prior.force_N)):
            inside &= (values >= low - margin * (high - low)) & (values <= high + margin * (high - low))
        return inside & (unknown[:, 3] > 0)


@dataclass(frozen=True, eq=False)
class _Sampled:
    """Chains of one likelihood: draws (KEPT, 4) of (x, y, log d, g), and how good they are."""

    draws: Array
    checks: dict[str, float | bool]
    effective: float
    misfit: float

    def spread_out(self, count: int) -> Array:
        """(count, 4) of the draws, evenly."""
        return self.draws[np.linspace(0, len(self.draws) - 1, count + 2).astype(int)[1:-1]]


def prior_of(forward: ForwardMap) -> Prior:
    """Uniform over the ranges of diameter and force of the training touches, and where the punch fits."""
    (_, d_low, f_low), (reach, d_high, f_high) = forward.bounds
    gap = max(forward.ring.radius_mm - reach - d_low / 2, 0.0)
    return Prior(forward.ring.radius_mm, float(gap), (float(d_low), float(d_high)), (float(f_low), float(f_high)))


def corrected(correction: Correction, unknown: Array) -> Array:
    """(n, readings) what a correction adds at touches (n, 4) given as (x, y, log d, g)."""
    return _linear((unknown - correction.middle) / correction.scale) @ correction.by


def posterior_of(forward: ForwardMap, signal_V: Array, noise_V: float, simulator: Simulator | None = None,
                 seed: int = 0) -> Posterior:
    """The posterior of one signal (readings,), V, under white noise; NotConverged where the simulator has no readings
    near the learned map's touch. Chains that end short say so in `checks`."""
    begun = time.process_time()
    start = invert(replace(forward, known_mm=np.zeros(0)), signal_V[None], noise_V).touch[0]
    constant = Correction(forward.mean, forward.sd, np.zeros((5, len(signal_V))))
    if simulator is None:
        found = _sampled(_framed(forward, signal_V, _of_map(forward, start, noise_V), constant), start, seed)
        held_out, solves = np.nan, 0
    else:
        found, held_out, solves = _by_simulator(forward, simulator, signal_V, noise_V, start, seed)
    return Posterior(to_touch(found.draws, forward.p0), found.checks, simulator is not None, held_out, found.effective,
                     solves, time.process_time() - begun, found.misfit)


def _by_simulator(forward: ForwardMap, simulator: Simulator, signal_V: Array, noise_V: float, start: Array,
                  seed: int) -> tuple[_Sampled, float, int]:
    """The chains, the corrected map's relative error at scenes held out of it, and how many scenes were solved."""
    peak = direct(simulator, forward, signal_V, noise_V, start)
    at = to_unknown(peak.touch[None], forward.p0)
    by = np.zeros((5, len(signal_V)))
    by[0] = peak.signal_V - linearise(forward, at).signal_V[0]
    first = _sampled(_framed(forward, signal_V, peak.unknowns, Correction(forward.mean, forward.sd, by)), peak.touch,
                     seed, rounds=1)
    correction, spread_V = _learned(forward, simulator, np.vstack([at, first.spread_out(DESIGN)]))
    unknowns = replace(peak.unknowns, white_V=float(np.hypot(peak.unknowns.white_V, spread_V)))
    frame = _framed(forward, signal_V, unknowns, correction)
    found = _sampled(frame, to_touch(first.spread_out(1), forward.p0)[0], seed + 1)
    return (found, _tested(frame, simulator, found.spread_out(HELD_OUT)),
            peak.simulations + 1 + DESIGN + HELD_OUT)


def _framed(forward: ForwardMap, signal_V: Array, unknowns: Unknowns, correction: Correction) -> _Frame:
    return _Frame(forward, signal_V, prior_of(forward), unknowns.whitening, correction)


def _of_map(forward: ForwardMap, touch: Array, noise_V: float) -> Unknowns:
    """Noise and the learned map's own error about a touch."""
    unknown = to_unknown(touch[None], forward.p0)
    here = linearise(forward, unknown)
    floor = floor_at(forward, unknown[:, :2], unknown[:, 3])[0] * np.linalg.norm(here.signal_V)
    return Unknowns(float(np.hypot(noise_V, floor)), here.doubt[0])


def _learned(forward: ForwardMap, simulator: Simulator, unknown: Array) -> tuple[Correction, float]:
    """The correction through scenes at touches (n, 4), and their scatter about it when left out one by one, V a
    reading; touches without readings are left out."""
    kept, apart = _apart(forward, simulator, unknown)
    if len(kept) < DESIGN // 2 + 1:
        raise NotConverged(f"the simulator solved {len(kept)} of {len(unknown)} touches of the posterior, too few to "
                           "correct the learned map. Give a --scene that asks for less accuracy, or leave --card out.",
                           estimate=kept)
    middle, scale = kept.mean(axis=0), np.maximum(kept.std(axis=0), 1e-9)
    phi = _linear((kept - middle) / scale)
    by = np.asarray(np.linalg.lstsq(phi, apart, rcond=1e-6)[0], np.float64)
    share = np.clip(np.einsum("nk,kn->n", phi, np.linalg.pinv(phi, rcond=1e-6)), 0, 0.9)
    left = (apart - phi @ by) / (1 - share)[:, None]
    return Correction(middle, scale, by), float(np.sqrt(np.mean(left**2)))


def _tested(frame: _Frame, simulator: Simulator, unknown: Array) -> float:
    """Relative error, RMS, of the corrected map at touches (n, 4); NaN where none has readings."""
    kept, apart = _apart(frame.forward, simulator, unknown)
    if not len(kept):
        return np.nan
    size = np.linalg.norm(linearise(frame.forward, kept).signal_V, axis=1)
    left = np.linalg.norm(apart - corrected(frame.correction, kept), axis=1) / size
    return float(np.sqrt(np.mean(left**2)))


def _apart(forward: ForwardMap, simulator: Simulator, unknown: Array) -> tuple[Array, Array]:
    """Touches that the simulator has readings of, and by how much these (n, readings), V, exceed the learned map's."""
    kept, found = [], []
    for one in unknown:
        try:
            found.append(solved(simulator, to_touch(one[None], forward.p0)[0]).signal_V)
        except NotConverged:
            continue
        kept.append(one)
    if not kept:
        return np.empty((0, 4)), np.empty((0, len(forward.ring.read)))
    points = np.array(kept)
    return points, np.array(found) - linearise(forward, points).signal_V


def _sampled(frame: _Frame, touch: Array, seed: int, rounds: int = ROUNDS) -> _Sampled:
    """Draws of a frame by chains on an emulator of the map, weighed by the map itself; points are added to the emulator
    where few draws are left of these."""
    ridge = _ridge(frame, to_unknown(touch[None], frame.forward.p0)[0])
    points = punch_ridge.points_about(ridge, 2 * emulator.wanted(4), REACH, np.random.default_rng([seed, 5]))
    points = points[frame.allowed(punch_ridge.bent(ridge, points), MARGIN)]
    residual = frame.residual(punch_ridge.bent(ridge, points))
    for _ in range(rounds):
        made = emulator.fit(points, residual)
        chains = run_ensembles(_density(frame, ridge, made), points[np.argmin(np.sum(residual**2, axis=1))],
                               _scale(points, residual), _derived(frame.forward, ridge), seed)
        draws = chains.spread_out(CHECKED)
        exact = frame.residual(punch_ridge.bent(ridge, draws))
        chi2 = np.sum(exact**2, axis=1)
        weight = _weights((emulator.chi_squared(made, draws) - chi2) / 2)
        if 1 / np.sum(weight**2) > ENOUGH * CHECKED:
            break
        points, residual = np.vstack([points, draws[::ADDED]]), np.vstack([residual, exact[::ADDED]])
    kept = draws[np.random.default_rng([seed, 6]).choice(CHECKED, KEPT, p=weight)]
    return _Sampled(punch_ridge.bent(ridge, kept), chains.checks, float(1 / np.sum(weight**2)),
                    float(chi2.min()) / (exact.shape[1] - 4))


def _weights(log_weight: Array) -> Array:
    weight = np.exp(log_weight - log_weight.max())
    return weight / weight.sum()


def _ridge(frame: _Frame, centre: Array) -> Ridge:
    forward, prior = frame.forward, frame.prior

    def load(log_d: Array) -> tuple[Array, Array]:
        low, high = (np.arcsinh(force / (np.exp(2 * log_d) * forward.p0)) for force in prior.force_N)
        return low, high

    def within(unknown: Array) -> Array:
        out = unknown.copy()
        out[:, :2] *= np.minimum(1, prior.reach_mm(prior.d_mm[0]) / np.maximum(np.hypot(*out[:, :2].T), 1e-9))[:, None]
        out[:, 3] = np.clip(out[:, 3], *load(out[:, 2]))
        return out

    return punch_ridge.find(frame.whitened, centre, (np.log(prior.d_mm[0]), np.log(prior.d_mm[1])), load, within)


def _scale(points: Array, residual: Array) -> Array:
    """(4,) spread of the points, weighed by a likelihood that counts a tenth of the data."""
    chi2 = np.sum(residual**2, axis=1)
    weight = np.exp(-0.05 * (chi2 - chi2.min()))
    mean = weight @ points / weight.sum()
    return np.sqrt(weight @ (points - mean) ** 2 / weight.sum()) + 1e-9


def _density(frame: _Frame, ridge: Ridge, made: Emulator) -> Callable[[Array, float], Array]:
    def density(straight: Array, share: float) -> Array:
        prior = log_prior(frame.forward, frame.prior, punch_ridge.bent(ridge, straight))
        return prior - share * emulator.chi_squared(made, straight) / 2

    return density


def log_prior(forward: ForwardMap, prior: Prior, unknown: Array) -> Array:
    """(n,) log density, but for a constant, in (x, y, log d, g) of touches uniform in (x, y, d, F)."""
    x, y, d, force = to_touch(unknown, forward.p0).T
    inside = ((np.hypot(x, y) <= prior.reach_mm(d)) & (d >= prior.d_mm[0]) & (d <= prior.d_mm[1])
              & (force >= prior.force_N[0]) & (force <= prior.force_N[1]))
    out = np.full(len(unknown), -np.inf)
    out[inside] = np.log(d[inside] * force[inside] / np.tanh(unknown[inside, 3]))
    return out


def _derived(forward: ForwardMap, ridge: Ridge) -> Callable[[Array], dict[str, Array]]:
    def derived(straight: Array) -> dict[str, Array]:
        return dict(zip(("x0", "y0", "d", "F"), to_touch(punch_ridge.bent(ridge, straight), forward.p0).T, strict=True))

    return derived


def _linear(scaled: Array) -> Array:
    return np.column_stack([np.ones(len(scaled)), scaled])
