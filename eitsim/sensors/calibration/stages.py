"""The staged fit: groups of parameters freed one after another, each kept where drives that it has not seen improve."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from eitsim.scene.drive import Protocol
from eitsim.sensors.calibration.instrument import GROUPS, Instrument, derivatives, voltages
from touchcal.arrays import Array, Mask

_ROUNDS, _SETTLED = 8, 0.01  # most estimates of the misfit in one fit, and the relative change that ends them
_TOLERANCE = 1e-4  # relative, of the squared misfit between steps
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
    its prior mean and tried once more after the last.
    """
    half = halves(frame.asked, seed)
    seen, unseen = frame.of(half), frame.of(~half)
    kept, stages, best, state = (), {}, np.inf, instrument.prior_mean
    found = None
    for group in [*GROUPS, *GROUPS]:
        if group in kept:
            continue
        one = fit_best(instrument, seen, (*kept, group), _starts(instrument, group, state))
        held_out = unexplained(instrument, unseen, one.state)
        stages[group] = Stage(unexplained(instrument, seen, one.state), held_out, held_out < best)
        if held_out < best:
            kept, best, state, found = (*kept, group), held_out, one.state, one
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
    mean, sd, free = instrument.prior_mean, instrument.prior_sd, mask(instrument, groups)
    there = np.isfinite(frame.volts)
    latest: dict[bytes, tuple[Array, Array]] = {}

    def state_of(white: Array) -> Array:
        change = np.zeros(instrument.size)
        change[free] = sd[free] * white
        return mean + instrument.gauged(change)

    def linearised(white: Array) -> tuple[Array, Array]:
        """Residuals (m,), V, and derivatives (m, q) by what is free, in prior standard deviations."""
        if (key := white.tobytes()) not in latest:
            try:
                model, change = derivatives(instrument, frame.asked, state_of(white))
            except ValueError:  # electrodes overlap: a step too long
                return np.full(there.sum(), np.inf), np.empty((there.sum(), len(white)))
            sign = np.ones(model.shape) if frame.signed else np.sign(model)
            change = instrument.gauged((sign[..., None] * change)[there])[:, free] * sd[free]
            latest.clear()
            latest[key] = (sign * model - frame.volts)[there], change
        return latest[key]

    white = ((start - mean) / sd)[free]
    residual, change = linearised(white)
    misfit, identity = float(np.sqrt(np.mean(residual**2))), np.eye(len(white))
    for _ in range(_ROUNDS if np.isfinite(misfit) else 0):
        white = least_squares(lambda w, s=misfit: np.concatenate([linearised(w)[0] / s, w]), white,
                              lambda w, s=misfit: np.vstack([linearised(w)[1] / s, identity]),
                              ftol=_TOLERANCE, xtol=1e-9, gtol=1e-12).x
        residual, change = linearised(white)
        normal = change.T @ change / misfit**2
        degrees = len(residual) - np.trace(np.linalg.solve(normal + identity, normal))
        before, misfit = misfit, float(np.sqrt(residual @ residual / degrees))
        if abs(misfit / before - 1) < _SETTLED:
            break
    root = np.diag(sd)
    if np.isfinite(misfit):
        inverse = np.linalg.inv(change.T @ change / misfit**2 + identity)
        root[np.ix_(free, free)] = sd[free][:, None] * np.linalg.cholesky(inverse)
    root = instrument.gauged(root.T)
    return Fit(state_of(white), misfit, float(2 * len(residual) * np.log(misfit) + white @ white), root.T @ root)


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
