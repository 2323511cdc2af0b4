"""The staged fit, which judges the model on half of the drives: groups of parameters freed in turn, each left out where
it predicts drives not fitted worse. The last fit frees all under their priors, from several starts.

A group that is held at a wrong value makes others wrong, with small standard deviations: widths fixed move electrodes,
and what an early stage gave to one group no later stage takes back. So what is not known of any is in the intervals.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from eitsim.scene.drive import Protocol
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, derivatives, voltages
from touchcal.arrays import Array, Index, Mask

_ROUNDS, _SETTLED = 8, 0.01  # most estimates of the misfit in one fit, and the relative change that ends them
_TOLERANCE, _STEPS = 1e-6, 30  # relative change of the squared misfit that ends a descent, and its most steps
# Starts of the contacts, in prior standard deviations of all together; random starts of the whole fit.
_CONTACT_STARTS, _RANDOM_STARTS = (-1.0, 0.0, 1.0), 2
_CLEARLY = 2.0  # standard errors by which drives that were not fitted may get worse
_MATTERS = 0.05  # part of what is left of those drives by which it must grow at least
_RUINED = 4.0  # times that what is left of those drives may grow, whatever its scatter over them
_DRIVEN = 1e-9  # share of a pattern's largest current below which an electrode carries none


@dataclass(frozen=True, eq=False)
class Untouched:
    """The untouched readings of some drives."""

    asked: Protocol
    volts: Array  # (patterns, readings) V, or the board's counts; NaN where dead
    signed: bool = True  # whether readings have a sign, or are magnitudes

    def of(self, patterns: Mask) -> "Untouched":
        """Those of some patterns."""
        return Untouched(Protocol(self.asked.currents_A[patterns], self.asked.weights[patterns]), self.volts[patterns],
                         self.signed)

    @property
    def off_driven(self) -> Mask:
        """(patterns, readings) those that are there and use no electrode which carries current."""
        uses = driven(self.asked)[:, None] & (self.asked.weights != 0)
        return ~uses.any(axis=2) & np.isfinite(self.volts)


@dataclass(frozen=True, eq=False)
class Fit:
    """A maximum of the posterior over some groups of parameters, the others at their prior mean."""

    state: Array  # (p,)
    misfit: float  # standard deviation of a reading about the model, V, by residual degrees of freedom
    cost: float  # minus twice the logarithm of the posterior, up to a constant
    covariance: Array  # (p, p) by the Gauss-Newton normal matrix and the misfit; gauges fixed


@dataclass(frozen=True)
class Stage:
    """What freeing one more group gave."""

    fitted: float  # part of the norm of readings off the driven electrodes that is left, on the drives of the fit
    held_out: float  # the same on the other drives
    kept: bool


def driven(asked: Protocol) -> Mask:
    """(patterns, N) electrodes that carry current."""
    size = np.abs(asked.currents_A)
    return size > _DRIVEN * size.max(axis=1, keepdims=True)


def drives(asked: Protocol) -> Index:
    """(patterns,) number of the drive of each pattern: those between the same electrodes are one."""
    return np.unique(driven(asked), axis=0, return_inverse=True)[1].ravel()


def halves(asked: Protocol, seed: int) -> Mask:
    """(patterns,) a random half of the drives."""
    drive = drives(asked)
    return (np.random.default_rng(seed).permutation(drive.max() + 1) % 2 == 0)[drive]


def left_over(instrument: Instrument, frame: Untouched, state: Array) -> Array:
    """(patterns,) squared 2-norm of what a state leaves of the readings off the driven electrodes, over that of all
    their readings."""
    where, model = frame.off_driven, voltages(instrument, frame.asked, state)
    left = np.where(where, frame.volts - (model if frame.signed else np.abs(model)), 0.0)
    return np.sum(left**2, axis=1) / np.sum(frame.volts[where] ** 2)


def unexplained(instrument: Instrument, frame: Untouched, state: Array) -> float:
    """2-norm of what a state leaves of the readings off the driven electrodes over theirs."""
    return float(np.sqrt(np.sum(left_over(instrument, frame, state))))


def harms(asked: Protocol, before: Array, after: Array) -> bool:
    """Whether what is left of patterns (patterns,) grows by more than twice the standard error of its sum over drives
    and by more than a twentieth; or to more than four times, which one ruined drive makes, whose own scatter hides it
    from the standard error."""
    worse = np.bincount(drives(asked), after - before)
    scatter = float(np.std(worse, ddof=1) * np.sqrt(len(worse))) if len(worse) > 1 else 0.0
    total = float(before.sum())
    return float(worse.sum()) > max(_CLEARLY * scatter, _MATTERS * total) or float(after.sum()) > _RUINED * total


def staged(instrument: Instrument, frame: Untouched, seed: int) -> tuple[dict[str, Stage], tuple[str, ...], Fit]:
    """Each stage by its group, the groups kept, and their fit to a random half of the drives.

    Groups are freed in the order of GROUPS. One by which the other half is predicted clearly worse is left at its prior
    mean, and tried again after the last until none is left that does no harm. What the last one gives is that of the
    best of several starts.
    """
    half = halves(frame.asked, seed)
    seen, unseen = frame.of(half), frame.of(~half)
    kept: tuple[str, ...] = ()
    found = Fit(instrument.prior_mean, np.inf, np.inf, np.diag(instrument.prior_sd**2))
    left, stages, before = np.full(len(unseen.volts), np.inf), {}, -1
    while len(kept) > before:
        before = len(kept)
        for group in (one for one in GROUPS if one not in kept):
            one = fit_best(instrument, seen, (*kept, group), _starts(instrument, group, found.state))
            after = left_over(instrument, unseen, one.state)
            keeps = not kept or not harms(unseen.asked, left, after)
            stages[group] = Stage(unexplained(instrument, seen, one.state), float(np.sqrt(after.sum())), keeps)
            if keeps:
                kept, found, left = (*kept, group), one, after
    found = fit_best(instrument, seen, kept, random_starts(instrument, kept, found.state, seed))
    left_of = (unexplained(instrument, part, found.state) for part in (seen, unseen))
    stages[[*kept][-1]] = Stage(*left_of, kept=True)
    return stages, kept, found


def jointly(instrument: Instrument, frame: Untouched, state: Array, seed: int) -> Fit:
    """All groups under their priors, the best from a state (p,), from the prior mean and from draws of the prior."""
    every = tuple(GROUPS)
    return fit_best(instrument, frame, every, [state, *random_starts(instrument, every, instrument.prior_mean, seed)])


def random_starts(instrument: Instrument, groups: Sequence[str], state: Array, seed: int) -> list[Array]:
    """A state, and that state with all but the conductance of the groups drawn from the prior."""
    chance, free = np.random.default_rng(seed), mask(instrument, groups) & ~mask(instrument, ["conductance"])
    draws = [instrument.prior_mean + instrument.gauged(instrument.prior_sd * chance.standard_normal(instrument.size))
             for _ in range(_RANDOM_STARTS)]
    return [state, *(np.where(free, draw, state) for draw in draws)]


def fit_best(instrument: Instrument, frame: Untouched, groups: Sequence[str], starts: Iterable[Array]) -> Fit:
    """The fit of lowest cost from several states (p,)."""
    return min((fit(instrument, frame, groups, start) for start in starts), key=lambda one: one.cost)


def fit(instrument: Instrument, frame: Untouched, groups: Sequence[str], start: Array) -> Fit:
    """Minimise |v - v(state)|^2 / misfit^2 + prior over the parameters of some groups from a state (p,), the misfit
    estimated from what is left, in turn."""
    problem, sd = _Whitened(instrument, frame, mask(instrument, groups)), instrument.prior_sd
    white = ((start - instrument.prior_mean) / sd)[problem.free]
    residual, change = problem.linearised(white)
    misfit, root = float(np.sqrt(np.mean(residual**2))), np.eye(len(white))
    for _ in range(_ROUNDS if np.isfinite(misfit) else 0):
        white = problem.minimum(white, misfit)
        residual, change = problem.linearised(white)
        degrees = len(residual) - len(white) + np.sum(_root(change / misfit) ** 2)
        if degrees < 1:  # the readings are interpolated, and say nothing of their noise
            break
        before, misfit = misfit, float(np.sqrt(residual @ residual / degrees))
        root = _root(change / misfit)
        if abs(misfit / before - 1) < _SETTLED:
            break
    whole = np.diag(sd)
    whole[np.ix_(problem.free, problem.free)] = root * sd[problem.free]
    whole = instrument.gauged(whole)
    cost = float(2 * len(residual) * np.log(misfit) + white @ white)
    return Fit(problem.state(white), misfit, cost, whole.T @ whole)


def _root(change: Array) -> Array:
    """(q, q) M with M' M the inverse of 1 + change' change, by change (m, q)."""
    triangle = np.linalg.qr(np.vstack([change, np.eye(change.shape[1])]), mode="r")
    return solve_triangular(triangle, np.eye(len(triangle))).T


@dataclass(frozen=True, eq=False)
class _Whitened:
    """Residuals by the free parameters, each in its prior standard deviation about its prior mean."""

    instrument: Instrument
    frame: Untouched
    free: Mask  # (p,)
    latest: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)  # the last answer, since it is asked twice

    def state(self, white: Array) -> Array:
        """(p,) of free parameters (q,)."""
        change = np.zeros(self.instrument.size)
        change[self.free] = self.instrument.prior_sd[self.free] * white
        return self.instrument.prior_mean + self.instrument.gauged(change)

    def linearised(self, white: Array) -> tuple[Array, Array]:
        """Residuals (m,), V, infinite where electrodes overlap, and their derivatives (m, q)."""
        if (key := white.tobytes()) not in self.latest:
            there = np.isfinite(self.frame.volts)
            try:
                groups = [group for group, own in self.instrument.places.items() if self.free[own].any()]
                model, change = derivatives(self.instrument, self.frame.asked, self.state(white), groups)
            except ValueError:  # electrodes overlap
                return np.full(there.sum(), np.inf), np.empty((there.sum(), len(white)))
            sign = np.ones(model.shape) if self.frame.signed else np.sign(model)
            change = self.instrument.gauged((sign[..., None] * change)[there]) * self.instrument.prior_sd
            self.latest.clear()
            self.latest[key] = (sign * model - self.frame.volts)[there], change[:, self.free]
        return self.latest[key]

    def minimum(self, white: Array, misfit: float) -> Array:
        """(q,) the least squares of residuals over the misfit and of the parameters themselves, from `white`."""
        def residuals(at: Array) -> Array:
            return np.concatenate([self.linearised(at)[0] / misfit, at])

        def by_parameter(at: Array) -> Array:
            return np.vstack([self.linearised(at)[1] / misfit, np.eye(len(at))])

        slopes: Any = by_parameter
        return least_squares(residuals, white, jac=slopes, ftol=_TOLERANCE, xtol=1e-9, gtol=1e-12, max_nfev=_STEPS).x


def mask(instrument: Instrument, groups: Iterable[str]) -> Mask:
    """(p,) which parameters belong to some groups."""
    out = np.zeros(instrument.size, dtype=bool)
    for group in groups:
        out[instrument.places[group]] = True
    return out


def _starts(instrument: Instrument, group: str, state: Array) -> list[Array]:
    if group != "contacts":
        return [state]
    shift = instrument.prior_sd * mask(instrument, [group])
    return [state + each * shift for each in _CONTACT_STARTS]
