"""Posterior of one touch from one frame by emcee: (x, y, d, F) uniform over the training touches' range.

The likelihood is the learned map's, its own error counted, the material the one that it was trained on; or that of the
map as `surrogate.single_frame.simulated_posterior` corrects it. Unlike the inversion it takes any diameter for equally
likely, known punches or not. Chains run on a polynomial of the residuals; the map itself weighs their draws. Where a
diameter has several loads, between which no chain passes, `branches` draws instead.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from matcal.posterior.ensembles import Derived, run_ensembles
from surrogate.bounds.fisher_information import Prior
from surrogate.data.sensor_ring import radial
from surrogate.forward_map.forward_map import ForwardMap, linearise, noise_floor, signal_size
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.inversion.multipole_location import pulled, sought
from surrogate.forward_map.load_coordinates import to_touch, to_unknown
from surrogate.single_frame import branches, diameter_profile, likelihood_emulator
from surrogate.single_frame.branches import Branches
from surrogate.single_frame.diameter_profile import Ridge
from surrogate.single_frame.likelihood_emulator import Emulator
from surrogate.single_frame.simulator_likelihood import Unknowns
from touchcal.arrays import Array, Mask
from touchcal.errors import NotConverged

# How far points of the emulator reach, in standard deviations, and outside the prior, over its ranges.
REACH, MARGIN = 2.0, 0.1
# Draws of the chains that the map itself weighs, the part that must be worth as much as draws of their own, every
# which one is added to the emulator's points where they are not, rounds, and CPU time, s, after which none begins.
CHECKED, ENOUGH, ADDED, ROUNDS, SPENT_S = 2000, 0.3, 5, 3, 25.0
TRIES = 10  # times that points are drawn, where the prior leaves few
KEPT = 1000  # draws that are kept
BATCH = 500  # touches that the learned map is asked for at once, to bound the memory


class Added(Protocol):
    """What is added to the map's signals."""

    def at(self, unknown: Array) -> tuple[Array, Array]:
        """(n, readings) V, and (n, readings, 4) its derivatives, at touches (n, 4) as (x, y, log d, g)."""
        ...


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of one touch."""

    draws: Array  # (KEPT, 4) x, y, d in mm, F in N
    # rhat, ess, autocorrelation_steps, steps, acceptance, converged, as matcal's chains give them; NaN but for ess and
    # converged where there are no chains
    checks: dict[str, float | bool]
    effective: float  # draws of their own that the weighed ones are worth
    cpu_s: float  # CPU time, s
    misfit: float  # squared residual, a degree of freedom, at the most probable draw


@dataclass(frozen=True, eq=False)
class _Frame:
    """What the likelihood is made of."""

    forward: ForwardMap
    signal_V: Array
    prior: Prior
    whiten: Array
    correction: Added | None

    def whitened(self, unknown: Array) -> tuple[Array, Array]:
        """Residuals (n, readings) of touches (n, 4), and their slopes (n, readings, 4)."""
        here = linearise(self.forward, unknown)
        signal, slope = here.signal_V, here.jacobian
        if self.correction is not None:
            added, by = self.correction.at(unknown)
            signal, slope = signal + added, slope + by
        return (signal - self.signal_V) @ self.whiten.T, np.einsum("qr,nrp->nqp", self.whiten, slope, optimize=True)

    def residual(self, unknown: Array) -> Array:
        """(n, readings) of many touches (n, 4)."""
        return np.concatenate([self.whitened(part)[0] for part in np.array_split(unknown, len(unknown) // BATCH + 1)])

    def allowed(self, unknown: Array, margin: float) -> Mask:
        """Which touches (n, 4) are in the prior's range, or outside it by up to this part."""
        _, _, d, force = to_touch(unknown, self.forward.p0).T
        inside = sought(self.forward, unknown)
        for values, (low, high) in ((d, self.prior.d_mm), (force, self.prior.force_N)):
            inside &= (values >= low - margin * (high - low)) & (values <= high + margin * (high - low))
        return inside & (unknown[:, 3] > 0)


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws by chains on an emulator, weighed and drawn again."""

    points: Array  # (KEPT, p) points
    # as matcal's chains give them; draws of their own that the weighed ones are worth; least squared residual
    checks: dict[str, float | bool]
    effective: float
    chi_squared: float


def prior_of(forward: ForwardMap) -> Prior:
    """Uniform over the ranges of diameter and force of the training touches, and where the punch fits, on a skin with
    an outline no nearer to its edges than the training touches; ValueError where these share one diameter or force."""
    (_, d_low, f_low), (reach, d_high, f_high) = forward.bounds
    for name, low, high in (("d", d_low, d_high), ("F", f_low, f_high)):
        if not low < high:
            raise ValueError(f"the training touches have one {name} alone, {low:g}, so that it has no posterior. "
                             f"Train on a sweep with a range of {name}, or read frames by `surrogate predict`.")
    gap = max(forward.ring.radius_mm - reach - d_low / 2, 0.0)
    return Prior(forward.ring.radius_mm, float(gap), (float(d_low), float(d_high)), (float(f_low), float(f_high)))


def posterior_of(forward: ForwardMap, signal_V: Array, noise_V: float, seed: int = 0) -> Posterior:
    """The posterior of one signal (readings,), V, under white noise. Chains that end short say so in `checks`;
    NotConverged where no touch of the prior is near the signal."""
    start = invert(replace(forward, known_mm=np.zeros(0)), signal_V[None], noise_V).touch
    unknown = to_unknown(start, forward.p0)
    here = linearise(forward, unknown)
    floor = (noise_floor(forward, unknown) * signal_size(forward, unknown))[0]
    whiten = Unknowns(float(np.hypot(noise_V, floor)), here.discrepancy[0]).whitening
    return sampled(forward, signal_V, whiten, start[0], seed)


def sampled(forward: ForwardMap, signal_V: Array, whiten: Array, touch: Array, seed: int,
            correction: Added | None = None) -> Posterior:
    """Draws about a touch (4,), where `whiten` (readings, readings) makes residuals standard normal."""
    begun = time.process_time()
    frame = _Frame(forward, signal_V, prior_of(forward), whiten, correction)
    ridge, found = _ridge(frame, to_unknown(touch[None], forward.p0)[0])
    if found.several:
        return _over_branches(frame, found, seed, begun)
    points = _points(frame, ridge, np.random.default_rng([seed, 5]))

    def derived(straight: Array) -> dict[str, Array]:
        touch = to_touch(diameter_profile.bent(ridge, straight), forward.p0)
        return dict(zip(("x0", "y0", "d", "F"), touch.T, strict=True))

    found = weighed_draws(lambda straight: frame.residual(diameter_profile.bent(ridge, straight)),
                          lambda straight: log_prior(forward, frame.prior, diameter_profile.bent(ridge, straight)),
                          derived, points, seed, begun + SPENT_S)
    return Posterior(to_touch(diameter_profile.bent(ridge, found.points), forward.p0), found.checks, found.effective,
                     time.process_time() - begun, found.chi_squared / (len(frame.signal_V) - 4))


def _points(frame: _Frame, ridge: Ridge, rng: np.random.Generator) -> Array:
    """(n, 4) straightened touches about a ridge, enough for an emulator, some of them within the prior; NotConverged
    where these are not to be had."""
    requested, found = likelihood_emulator.requested(4), np.empty((0, 4))
    for _ in range(TRIES):
        points = diameter_profile.points_about(ridge, 2 * requested, REACH, rng)
        found = np.vstack([found, points[frame.allowed(diameter_profile.bent(ridge, points), MARGIN)]])
        if len(found) >= requested and np.isfinite(log_prior(frame.forward, frame.prior,
                                                             diameter_profile.bent(ridge, found))).any():
            return found
    raise NotConverged("no touch within the training range is near this frame, so that it has no posterior there. "
                       "Sweep and train on a wider range.")


def weighed_draws(residual: Callable[[Array], Array], log_prior: Callable[[Array], Array], derived: Derived,
                  points: Array, seed: int, until_s: float = np.inf) -> Draws:
    """Draws of exp(log_prior(u) - |residual(u)|^2 / 2) by chains on an emulator of the residuals (n, readings), first
    through points (n, p) about the posterior, one or more of them of finite prior, each draw weighed by what the
    emulator misses.

    Draws are added to the emulator's points where few are left, unless the process has used until_s of CPU time.
    """
    at = residual(points)
    for _ in range(ROUNDS):
        made = likelihood_emulator.fit(points, at)
        best = np.argmin(np.where(np.isfinite(log_prior(points)), np.sum(at**2, axis=1), np.inf))
        chains = run_ensembles(_density(log_prior, made), points[best], _scale(points, at), derived, seed)
        draws = chains.spread_out(CHECKED)
        exact = residual(draws)
        chi2 = np.sum(exact**2, axis=1)
        log_weight = (likelihood_emulator.chi_squared(made, draws) - chi2) / 2
        weight = np.exp(log_weight - log_weight.max())
        weight = weight / weight.sum()
        effective = float(1 / np.sum(weight**2))
        if effective > ENOUGH * CHECKED or time.process_time() > until_s:
            break
        points, at = np.vstack([points, draws[::ADDED]]), np.vstack([at, exact[::ADDED]])
    kept = draws[np.random.default_rng([seed, 6]).choice(CHECKED, KEPT, p=weight)]
    return Draws(kept, chains.checks, effective, float(chi2.min()))


def _over_branches(frame: _Frame, found: Branches, seed: int, begun: float) -> Posterior:
    """Importance draws, where a diameter has several loads; chains tell nothing then."""
    rng = np.random.default_rng([seed, 5])
    drawn = branches.draws(found, frame.residual, lambda u: log_prior(frame.forward, frame.prior, u), rng)
    kept = drawn.touch[rng.choice(len(drawn.weight), KEPT, p=drawn.weight)]
    checks = dict.fromkeys(("rhat", "autocorrelation_steps", "steps", "acceptance"), np.nan)
    return Posterior(to_touch(kept, frame.forward.p0), checks | {"ess": drawn.effective, "converged": True},
                     drawn.effective, time.process_time() - begun, drawn.chi_squared / (len(frame.signal_V) - 4))


def _ridge(frame: _Frame, centre: Array) -> tuple[Ridge, Branches]:
    forward, prior = frame.forward, frame.prior

    def load(log_d: Array) -> tuple[Array, Array]:
        low, high = (np.arcsinh(force / (np.exp(2 * log_d) * forward.p0)) for force in prior.force_N)
        return low, high

    def within(unknown: Array) -> Array:
        out = unknown.copy()
        out[:, :2] = pulled(forward, out[:, :2], float(prior.reach_mm(prior.d_mm[0])))
        out[:, 3] = np.clip(out[:, 3], *load(out[:, 2]))
        return out

    ridge = diameter_profile.find(frame.whitened, centre, (np.log(prior.d_mm[0]), np.log(prior.d_mm[1])), load, within)
    return ridge, branches.find(frame.whitened, ridge, load, within)


def _scale(points: Array, residual: Array) -> Array:
    """(4,) spread of the points, weighed by a likelihood that counts a tenth of the data."""
    chi2 = np.sum(residual**2, axis=1)
    weight = np.exp(-0.05 * (chi2 - chi2.min()))
    mean = weight @ points / weight.sum()
    return np.sqrt(weight @ (points - mean) ** 2 / weight.sum()) + 1e-9


def _density(log_prior: Callable[[Array], Array], made: Emulator) -> Callable[[Array, float], Array]:
    return lambda u, share: log_prior(u) - share * likelihood_emulator.chi_squared(made, u) / 2


def log_prior(forward: ForwardMap, prior: Prior, unknown: Array) -> Array:
    """(n,) log density, but for a constant, in (x, y, log d, g) of touches uniform in (x, y, d, F)."""
    _, _, d, force = to_touch(unknown, forward.p0).T
    far = forward.ring.radius_mm * radial(forward.ring, unknown)  # from the centre of a disc
    inside = ((far <= prior.reach_mm(d)) & (d >= prior.d_mm[0]) & (d <= prior.d_mm[1])
              & (force >= prior.force_N[0]) & (force <= prior.force_N[1]))
    out = np.full(len(unknown), -np.inf)
    out[inside] = np.log(d[inside] * force[inside] / np.tanh(unknown[inside, 3]))
    return out
