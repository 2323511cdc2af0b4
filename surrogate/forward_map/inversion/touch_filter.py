"""A touch followed through the frames of a stream: an iterated extended Kalman filter on the forward map.

The state s = (x, y, log d, g) walks at random, but for d, which stays. A frame reads y = f(s) + E e + n: n is white
noise, new in each frame; e are standard normal constants, the errors of the map, of the untouched frame and its drift,
which no number of frames averages out. They are considered and not estimated (Schmidt, Application of state-space
methods to navigation problems, Adv. Control Systems 3 (1966) 293): the filter keeps the covariance of its own error
with e. Where the touch moves or its load changes, e is renewed by the part of its length that was gone.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from surrogate.forward_map.forward_map import ForwardMap, linearise, signal_size, strength_discrepancy
from surrogate.forward_map.inversion import reading_covariance
from surrogate.forward_map.inversion.multipole_location import on_range
from touchcal.arrays import Array, Mask

# Movement in a second, standard deviation: of x and y, mm, of log d, and of g.
WALK = np.array([10.0, 10.0, 0.0, 2.0])
# Movement of x, y, mm, log d and g over which the map's error is another one, and the part of it that is counted at
# once, since noise moves a touch too.
RENEWED, AT_ONCE = np.array([20.0, 20.0, 0.5, 1.0]), 0.25
STEPS, ENOUGH = 4, 0.1  # most steps of a frame, and the step, in standard deviations, that is the last


@dataclass(frozen=True, eq=False)
class Followed:
    """A touch after some frames."""

    mean: Array  # (4,) x, y, mm, log d, g
    covariance: Array  # (4, 4)
    # (4, constants) covariance of the error s - mean with e: of each reading, of the map's discrepancies, of the
    # directions of its error at the rim, of the drift
    shared: Array
    anchor: Array  # (4,) mean where e was last renewed
    misfit: float  # squared innovation over what was expected of it, a reading


@dataclass(frozen=True, eq=False)
class Unsure:
    """What is not known of the readings besides the map."""

    noise_V: float  # standard deviation of white noise, new in each frame
    rest_V: float  # of the error of the untouched frame, a reading
    drift: Array  # (k, readings) root of the covariance of its drift since it was seen, V
    kept: Mask  # (readings,) channels that are alive


def unseen(forward: ForwardMap, unsure: Unsure) -> Followed:
    """What the training touches say of a touch before any frame."""
    directions = min(forward.beside.error.alike.shape[2:])
    constants = len(unsure.kept) + forward.discrepancies + directions + len(unsure.drift)
    return Followed(forward.mean, np.diag(forward.sd**2), np.zeros((4, constants)), forward.mean, 1.0)


def later(forward: ForwardMap, touch: Followed, step_s: float) -> Followed:
    """The touch so many seconds later."""
    gone = float(np.linalg.norm((touch.mean - touch.anchor) / RENEWED))
    covariance = touch.covariance + np.diag(WALK**2 * step_s)
    if gone < AT_ONCE:
        return replace(touch, covariance=covariance)
    # the material and what follows it stay what they are
    shared, whole = touch.shared.copy(), len(forward.ring.read) + forward.own
    shared[:, :whole] *= np.exp(-gone)
    first = whole + forward.materials
    shared[:, first:first + min(forward.beside.error.alike.shape[2:])] *= np.exp(-gone)
    return replace(touch, covariance=covariance, shared=shared, anchor=touch.mean)


def seen(forward: ForwardMap, before: Followed, signal: Array, unsure: Unsure, start: Array | None = None) -> Followed:
    """With one more frame of this signal (readings,), V; the search begins at `start` (4,), or at the mean."""
    state, kept = before.mean if start is None else start, unsure.kept
    discrepancy = strength_discrepancy(forward, state[None])
    floor, axes, sd = reading_covariance.own_error(forward, state[None], signal_size(forward, state[None]))
    white = np.hypot(floor[0], unsure.rest_V)
    for _ in range(STEPS):
        here = linearise(forward, state[None], discrepancy)
        slope = here.jacobian[0, kept]
        alike = np.hstack([here.discrepancy[0], axes[0] * sd[0], unsure.drift.T])[kept]
        update = _update(before, slope, white, alike, unsure)
        innovation = (signal - here.signal_V[0])[kept] - slope @ (before.mean - state)
        trial = on_range(forward, (before.mean + update.gain @ innovation)[None])[0]
        step, state = np.abs(trial - state), trial
        if np.all(step < ENOUGH * np.sqrt(np.diag(update.covariance))):
            break
    misfit = float(innovation @ cho_solve(update.factor, innovation)) / len(innovation)
    return Followed(state, update.covariance, update.shared, before.anchor if start is None else state, misfit)


@dataclass(frozen=True, eq=False)
class _Update:
    gain: Array  # (4, kept)
    covariance: Array  # (4, 4)
    shared: Array  # (4, constants)
    factor: tuple[Array, bool]  # of the covariance of the innovation


def _update(before: Followed, slope: Array, white: float, alike: Array, unsure: Unsure) -> _Update:
    """The consider filter's update by readings of this slope (kept, 4), whose errors are white constants of standard
    deviation `white` and `alike` (kept, rest) times the others."""
    own = np.flatnonzero(unsure.kept)
    others = np.s_[len(unsure.kept):]
    by_constants = white * before.shared[:, own] + before.shared[:, others] @ alike.T
    across = before.covariance @ slope.T + by_constants
    whole = slope @ across + by_constants.T @ slope.T + alike @ alike.T
    whole[np.diag_indices(len(own))] += white**2 + unsure.noise_V**2
    factor = cho_factor(whole, check_finite=False)
    gain = cho_solve(factor, across.T, check_finite=False).T
    covariance = before.covariance - gain @ across.T
    shared = before.shared - gain @ (slope @ before.shared)
    shared[:, own] -= white * gain
    shared[:, others] -= gain @ alike
    return _Update(gain, (covariance + covariance.T) / 2, shared, factor)
