"""A touch followed through the frames of a stream: a sum of extended Kalman filters on the forward map.

The state s = (x, y, log d, g) walks at random, but for d, which stays. A frame reads y = f(s) + E e + n: n is white
noise, new in each frame; e are standard normal constants, the errors of the map, of the untouched frame and its drift,
which no number of frames averages out. They are considered and not estimated (Schmidt, Application of state-space
methods to navigation problems, Adv. Control Systems 3 (1966) 293): a filter keeps the covariance of its own error
with e. Where the touch moves or its load changes, e is renewed by the part of its length that was gone.

Punches of different d and F have nearly one signal, on a curved ridge. So each known diameter has a filter of its own,
and so have some cells of the range (Alspach, Sorenson, Nonlinear Bayesian estimation using Gaussian sum approximations,
IEEE Trans. Autom. Control 17 (1972) 439). Each is weighed by the likelihood of the mean of what frames left since the
touch was where e was another: these share e, so that those of single frames are no independent evidence.
"""

from dataclasses import dataclass, replace

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap, linearise, signal_size, strength_discrepancy
from surrogate.forward_map.inversion import reading_covariance
from surrogate.forward_map.inversion.multipole_location import on_range
from surrogate.forward_map.load_coordinates import to_unknown
from touchcal.arrays import Array, Index, Mask

# Movement in a second, standard deviation: of x and y, mm, of log d, and of g.
WALK = np.array([10.0, 10.0, 0.0, 2.0])
# Movement of x, y, mm, log d and g over which the map's error is another one, and the part of it that is counted at
# once, since noise moves a touch too.
RENEWED, AT_ONCE = np.array([20.0, 20.0, 0.5, 1.0]), 0.25
# Most steps of a frame; movement over which the map is nearly linear, the part of a signal's norm that it bends by over
# one, and the part of the error of a reading that it may bend by in the last step: over the frames of a touch such
# errors of log d add up.
STEPS, STRAIGHT, BENT, ENOUGH = 6, np.array([3.0, 3.0, 0.1, 0.2]), 0.05, 0.03
# Cells of the range of log d, alone and besides known punches; standard deviation of log d of a known punch.
CELLS, OTHER_CELLS, KNOWN = 6, 3, 1e-6
RULED_OUT = 10.0  # log weight below the largest from which a filter ends
ALIKE = 0.5  # distance in standard deviations below which two filters are one
LOG_D = 2  # place of log d in a state


@dataclass(frozen=True, eq=False)
class Followed:
    """A touch after some frames: k filters."""

    log_weight: Array  # (k,) log probabilities
    log_before: Array  # (k,) those before the frames that `left` is the mean of
    left: Array  # (k, m) mean of what the latest frames left, V
    frames: int  # how many these are
    since: Array  # (4,) mean when they began
    mean: Array  # (k, 4) x, y, mm, log d, g
    covariance: Array  # (k, 4, 4)
    # (k, 4, constants) covariance of the error s - mean with e: of each reading, of the map's discrepancies, of the
    # directions of its error at the rim, of the drift
    shared: Array
    anchor: Array  # (k, 4) mean where e was last renewed
    misfit: Array  # (k,) squared innovation over what was expected of it, a reading


@dataclass(frozen=True, eq=False)
class Unsure:
    """What is not known of the readings besides the map."""

    noise_V: float  # standard deviation of white noise, new in each frame
    rest_V: float  # of the error of the untouched frame, a reading
    # (k, readings) root of the covariance of its drift since it was seen, V; the last `fresh` rows are noise that
    # readings share, new in each frame
    drift: Array
    kept: Mask  # (readings,) channels that are alive
    axes: Array  # (kept, m) orthonormal readings that span all signals
    fresh: int = 0


def best(touch: Followed) -> int:
    """The most probable filter."""
    return int(np.argmax(touch.log_weight))


def unseen(forward: ForwardMap, unsure: Unsure) -> Followed:
    """What the training touches say of a touch before any frame."""
    directions = forward.correction.error.directions
    constants = len(unsure.kept) + forward.discrepancies + directions + len(unsure.drift)
    log_weight, log_d, sd = _diameters(forward)
    mean, covariance = np.tile(forward.mean, (len(log_d), 1)), np.tile(np.diag(forward.sd**2), (len(log_d), 1, 1))
    mean[:, LOG_D], covariance[:, LOG_D, LOG_D] = log_d, sd**2
    return Followed(log_weight, log_weight, np.zeros((len(log_d), 0)), 0, forward.mean, mean, covariance,
                    np.zeros((len(log_d), 4, constants)), mean, np.ones(len(log_d)))


def _diameters(forward: ForwardMap) -> tuple[Array, Array, Array]:
    """Log probabilities, means and standard deviations of log d of the filters."""
    lowest, highest = np.log(forward.bounds[:, 1])
    known = np.log(forward.known_mm)
    cells = (OTHER_CELLS if len(known) else CELLS) if highest > lowest + 1e-3 else 1
    other, width = 1 / (forward.rows + 2) if len(known) else 1.0, (highest - lowest) / cells
    weight = np.r_[np.full(len(known), (1 - other) / max(len(known), 1)), np.full(cells, other / cells)]
    return (np.log(weight), np.r_[known, lowest + width * (np.arange(cells) + 0.5)],
            np.r_[np.full(len(known), KNOWN), np.full(cells, max(width / 2, KNOWN))])


def later(forward: ForwardMap, touch: Followed, step_s: float) -> Followed:
    """The touch so many seconds later."""
    gone = np.linalg.norm((touch.mean - touch.anchor) / RENEWED, axis=1)
    far = gone > AT_ONCE
    # the material and the drift stay what they are
    whole, directions = len(forward.ring.read) + forward.own, forward.correction.error.directions
    own = np.r_[:whole, whole + forward.materials:whole + forward.materials + directions]
    shared = touch.shared.copy()
    shared[:, :, own] *= np.where(far, np.exp(-gone), 1.0)[:, None, None]
    return replace(touch, covariance=touch.covariance + np.diag(WALK**2 * step_s), shared=shared,
                   anchor=np.where(far[:, None], touch.mean, touch.anchor))


def seen(forward: ForwardMap, before: Followed, signal: Array, unsure: Unsure, start: Array | None = None) -> Followed:
    """With one more frame of this signal (readings,), V; the search begins at the means, or with the place and force of
    `start` (4,), a touch (x, y, d, F)."""
    if unsure.fresh:
        shared = before.shared.copy()
        shared[:, :, -unsure.fresh:] = 0.0
        before = replace(before, shared=shared)
    state, kept = before.mean if start is None else _with_force(forward, before.mean, start), unsure.kept
    discrepancy = strength_discrepancy(forward, state)
    # one error for all filters: else those where it is said to be small are the likely ones, whatever they leave
    one = before.mean[[best(before)]] if start is None else to_unknown(start[None], forward.p0)
    floor, axes, sd = reading_covariance.own_error(forward, one, signal_size(forward, one))
    white, at_rim = (np.broadcast_to(part, (len(state), *part.shape[1:]))
                     for part in (np.hypot(floor, unsure.rest_V), axes * sd[:, None]))
    onto, own = _turned(unsure.axes[None]), forward.discrepancies
    constant = onto @ np.concatenate([at_rim, np.broadcast_to(unsure.drift.T, (len(state), *unsure.drift.T.shape))],
                                     axis=2)[:, kept]
    remembered = before.shared[:, :, :len(kept)][:, :, kept] @ unsure.axes
    common = np.empty((*constant.shape[:2], own + constant.shape[2]))
    common[..., own:], read = constant, signal[kept] @ unsure.axes
    for _ in range(STEPS):
        here = linearise(forward, state, discrepancy)
        along = onto @ (here.columns if kept.all() else here.columns[:, kept])
        slope, common[..., :own] = along[..., 1:5], along[..., 5:]
        innovation = read - along[..., 0] - _times(slope, before.mean - state)
        update = _update(before, slope, white, remembered, common, innovation, unsure)
        trial = on_range(forward, before.mean + update.step)
        bent = BENT * np.sum(((trial - state) / STRAIGHT) ** 2, axis=1) * np.linalg.norm(here.signal_V, axis=1)
        state = trial
        if np.all(bent < ENOUGH * np.hypot(white, unsure.noise_V)):
            break
    weighed = _weighed(before, innovation - _times(slope, update.step), update, unsure.noise_V)
    covariance, shared = _carried(before, update, white, unsure)
    return _fewer(replace(weighed, mean=state, covariance=covariance, shared=shared,
                          anchor=state if start is not None else before.anchor,
                          since=state[best(before)] if not before.frames else weighed.since,
                          misfit=update.cost / innovation.shape[1]))


def _with_force(forward: ForwardMap, mean: Array, touch: Array) -> Array:
    punch = np.column_stack([np.tile(touch[:2], (len(mean), 1)), np.exp(mean[:, LOG_D]),
                             np.full(len(mean), max(touch[3], forward.bounds[0, 2]))])
    return to_unknown(punch, forward.p0)


@dataclass(frozen=True, eq=False)
class _Update:
    step: Array  # (k, 4) from the means
    gain: Array  # (k, 4, r)
    slope: Array  # (k, r, 4)
    common: Array  # (k, r, rest)
    across: Array  # (k, 4, r) covariance of the error s - mean with the innovation
    cost: Array  # (k,) squared innovation over its covariance
    onto: Array  # (k, m, r) orthonormal readings that the touch and errors other than white ones reach
    whole: Array  # (k, r, r) covariance of the innovation along these
    elsewhere_V2: Array  # (k,) its variance, V^2, along every other


def _weighed(before: Followed, left: Array, update: _Update, noise_V: float) -> Followed:
    """With the probabilities by what one more frame left (k, m), of innovations of an update's covariance: large along
    what the touch may have moved by, where little is left."""
    gone = np.linalg.norm((before.mean[best(before)] - before.since) / RENEWED)
    again = left.shape[1] != before.left.shape[1] or gone > 1
    log_before, frames = (before.log_weight, 0) if again else (before.log_before, before.frames)
    mean = left if not frames else before.left + (left - before.left) / (frames + 1)
    fewer = noise_V**2 * frames / (frames + 1)  # of the noise that a mean has not
    averaged = update.whole - fewer * np.eye(update.whole.shape[-1])
    along, rest = _parts(update.onto, mean)
    elsewhere_V2 = update.elsewhere_V2 - fewer
    cost = np.sum(along * np.linalg.solve(averaged, along[..., None])[..., 0], axis=1) + rest / elsewhere_V2
    log_size = np.linalg.slogdet(averaged)[1] + (left.shape[1] - along.shape[1]) * np.log(elsewhere_V2)
    log_weight = log_before - 0.5 * (cost + log_size)
    return replace(before, log_weight=log_weight - np.logaddexp.reduce(log_weight), log_before=log_before,
                   left=mean, frames=frames + 1, since=before.mean[best(before)] if again else before.since)


def _update(before: Followed, slope: Array, white: Array, remembered: Array, common: Array, innovation: Array,
            unsure: Unsure) -> _Update:
    """The consider filter's update by m readings of these slopes (k, m, 4), whose errors are white constants of
    standard deviations (k,), which the error of the mean remembers (k, 4, m), and `common` (k, m, rest) times the
    others; solved along the few readings that anything but white errors reaches."""
    scaled = white[:, None, None]
    by_constants = scaled * remembered + before.shared[:, :, len(unsure.kept):] @ _turned(common)
    onto = np.asarray(np.linalg.qr(np.concatenate([slope, _turned(by_constants), common], axis=2))[0], np.float64)
    slope, common, by_constants = _turned(onto) @ slope, _turned(onto) @ common, by_constants @ onto
    across = before.covariance @ _turned(slope) + by_constants
    whole = slope @ across + _turned(slope @ by_constants) + common @ _turned(common)
    whole += (scaled**2 + unsure.noise_V**2) * np.eye(slope.shape[1])
    along, rest = _parts(onto, innovation)
    solved = np.linalg.solve(whole, np.concatenate([_turned(across), along[..., None]], axis=2))
    gain = _turned(np.asarray(solved[..., :4], np.float64))
    elsewhere_V2 = white**2 + unsure.noise_V**2
    return _Update(_times(gain, along), gain, slope, common, across,
                   np.sum(along * solved[..., 4], axis=1) + rest / elsewhere_V2, onto, whole, elsewhere_V2)


def _carried(before: Followed, update: _Update, white: Array, unsure: Unsure) -> tuple[Array, Array]:
    """Covariances (k, 4, 4) and shared ones (k, 4, constants) after an update."""
    gain = update.gain
    covariance = before.covariance - gain @ _turned(update.across)
    shared = before.shared - gain @ (update.slope @ before.shared)
    shared[:, :, np.flatnonzero(unsure.kept)] -= white[:, None, None] * (gain @ _turned(update.onto) @ unsure.axes.T)
    shared[:, :, len(unsure.kept):] -= gain @ update.common
    return (covariance + _turned(covariance)) / 2, shared


def _parts(onto: Array, readings: Array) -> tuple[Array, Array]:
    """Readings (k, m) along orthonormal ones (k, m, r), and the squares (k,) of what is left."""
    along = _times(_turned(onto), readings)
    return along, np.sum((readings - _times(onto, along)) ** 2, axis=1)


def _turned(matrix: Array) -> Array:
    return matrix.transpose(0, 2, 1)


def _times(matrix: Array, vector: Array) -> Array:
    return (matrix @ vector[..., None])[..., 0]


def _fewer(touch: Followed) -> Followed:
    """Without filters that are ruled out, or that follow what a more probable one does."""
    kept: list[int] = []
    added = touch.log_before.copy()
    for one in np.argsort(-touch.log_weight).tolist():
        if touch.log_weight[one] < touch.log_weight.max() - RULED_OUT:
            break
        same = next((other for other in kept if _alike(touch, one, other)), None)
        if same is None:
            kept.append(one)
        else:
            added[same] = np.logaddexp(added[same], touch.log_before[one])
    gained = touch.log_weight - touch.log_before
    return _some(replace(touch, log_before=added, log_weight=added + gained), np.array(kept))


def _alike(touch: Followed, one: int, other: int) -> bool:
    own, its = (touch.covariance[k, LOG_D, LOG_D] for k in (one, other))
    off = touch.mean[one, LOG_D] - touch.mean[other, LOG_D]
    return bool(0.5 < own / its < 2 and off**2 < ALIKE**2 * its)


def _some(touch: Followed, kept: Index) -> Followed:
    log_weight = touch.log_weight[kept]
    names = ("log_before", "left", "mean", "covariance", "shared", "anchor", "misfit")
    return replace(touch, log_weight=log_weight - np.logaddexp.reduce(log_weight),
                   **{name: getattr(touch, name)[kept] for name in names})
