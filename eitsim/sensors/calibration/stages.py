"""The staged fit: groups of parameters freed one after another, each kept where drives that it has not seen improve."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from eitsim.scene.drive import Protocol
from eitsim.sensors.calibration.instrument import GROUPS, Instrument, derivatives, voltages
from touchcal.arrays import Array, Mask

_ROUNDS, _SETTLED = 8, 0.01  # most estimates of the misfit in one fit, and the relative change that ends them
_TOLERANCE = 1e-6  # relative, of the squared misfit between steps
# Starts of the contacts, in prior standard deviations of all together; random starts of the whole fit.
_CONTACT_STARTS, _RANDOM_STARTS = (-1.0, 0.0, 1.0), 2
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
    # (p, p) by the Gauss-Newton normal matrix and the misfit, the prior's where a group is held; gauges fixed
    covariance: Array


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


def halves(asked: Protocol, seed: int) -> Mask:
    """(patterns,) a random half of the drives; those between the same electrodes stay together."""
    drive = np.unique(driven(asked), axis=0, return_inverse=True)[1].ravel()
    return (np.random.default_rng(seed).permutation(drive.max() + 1) % 2 == 0)[drive]


def unexplained(instrument: Instrument, frame: Untouched, state: Array) -> float:
    """2-norm of what a state leaves of the readings off the driven electrodes over theirs."""
    where, model = frame.off_driven, voltages(instrument, frame.asked, state)
    left = frame.volts - (model if frame.signed else np.abs(model))
    return float(np.linalg.norm(left[where]) / np.linalg.norm(frame.volts[where]))


def staged(instrument: Instrument, frame: Untouched, seed: int) -> tuple[dict[str, Stage], tuple[str, ...], Fit]:
    """Each stage by its group, the groups kept, and their fit to a random half of the drives.

    Groups are freed in the order of GROUPS; one that does not lower what is unexplained of the other half is left at
    its prior mean, and tried again after the last until none is left that lowers it.
    """
    half = halves(frame.asked, seed)
    seen, unseen = frame.of(half), frame.of(~half)
    kept: tuple[str, ...] = ()
    found: Fit | None = None
    stages, before = {}, -1
    while len(kept) > before:
        before = len(kept)
        for group in (one for one in GROUPS if one not in kept):
            best, state = (stages[kept[-1]].held_out, found.state) if found else (np.inf, instrument.prior_mean)
            one = fit_best(instrument, seen, (*kept, group), _starts(instrument, group, state))
            held_out = unexplained(instrument, unseen, one.state)
            stages[group] = Stage(unexplained(instrument, seen, one.state), held_out, held_out < best)
            if held_out < best:
                kept, found = (*kept, group), one
    assert found is not None
    return stages, kept, found


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
    misfit, identity = float(np.sqrt(np.mean(residual**2))), np.eye(len(white))
    for _ in range(_ROUNDS if np.isfinite(misfit) else 0):
        white = problem.minimum(white, misfit)
        residual, change = problem.linearised(white)
        normal = change.T @ change / misfit**2
        degrees = len(residual) - np.trace(np.linalg.solve(normal + identity, normal))
        before, misfit = misfit, float(np.sqrt(residual @ residual / degrees))
        if abs(misfit / before - 1) < _SETTLED:
            break
    root = np.diag(sd)
    if np.isfinite(misfit):
        inverse = np.linalg.inv(change.T @ change / misfit**2 + identity)
        root[np.ix_(problem.free, problem.free)] = sd[problem.free][:, None] * np.linalg.cholesky(inverse)
    root = instrument.gauged(root.T)
    return Fit(problem.state(white), misfit, float(2 * len(residual) * np.log(misfit) + white @ white), root.T @ root)


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
                model, change = derivatives(self.instrument, self.frame.asked, self.state(white))
            except ValueError:
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
        return least_squares(residuals, white, jac=slopes, ftol=_TOLERANCE, xtol=1e-9, gtol=1e-12).x


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
