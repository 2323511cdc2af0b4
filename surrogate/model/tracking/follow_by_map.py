"""Touches followed on the forward map: started from the batch search, then one filter step a frame."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.untouched_stream import principal
from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.inversion import followed_punch, touch_filter
from surrogate.forward_map.inversion.invert import Inversion, invert
from surrogate.forward_map.inversion.pair_search import left_by_pair
from surrogate.forward_map.inversion.reading_covariance import Drift
from surrogate.forward_map.inversion.touch_filter import Followed, Unsure, best
from surrogate.learners.base import Estimate, Learner
from surrogate.learners.forward import TouchInversion, answered
from surrogate.statistics.conformal import IntervalScale
from touchcal.arrays import Array

# Misfit of a frame over what its noise lets be from which the touch is sought again, and of the new one over the old
# misfit from which it is taken for another touch.
UNFIT, BETTER = 6.0, 0.8
FURTHER = 0.5  # part of what one touch leaves that two may leave
MOST_WAITED = 64  # frames that a search in vain is waited for, at most; it doubles each time


@dataclass(frozen=True, eq=False)
class Touch:
    """A touch that is followed."""

    filter: Followed
    onward: Followed  # what goes on to the next frame: one that is of no single touch teaches nothing
    wait: int = 0  # frames before it may be sought again
    waited: int = 1  # frames that the next search in vain is waited for


def fits(touch: Touch, unsure: Unsure) -> bool:
    """Whether the latest frame is one of a single touch."""
    return _misfit(touch) < 1 + UNFIT * np.sqrt(2 / unsure.axes.shape[1])


def _misfit(touch: Touch) -> float:
    return float(touch.filter.misfit[best(touch.filter)])


def several(forward: ForwardMap, touch: Touch, signal: Array, unsure: Unsure) -> bool:
    """Whether two touches leave far less of a signal (readings,) than the one that does not fit it; not told where
    channels are dead."""
    if fits(touch, unsure) or not unsure.kept.all():
        return False
    left = signal - linearise(forward, touch.filter.mean[[best(touch.filter)]]).signal_V[0]
    return left_by_pair(forward, signal) < FURTHER * float(left @ left)


def follow(learner: TouchInversion, sought_by: Callable[[], Learner], before: Touch | None, signal: Array,
           unsure: Unsure, step_s: float) -> tuple[Touch, Inversion]:
    """The touch after one more frame of this signal (readings,), and what it is now; sought_by makes the learner
    without the dead channels."""
    forward = learner.forward
    if before is not None:
        expected = touch_filter.later(forward, before.onward, step_s)
        touch = replace(before, filter=touch_filter.seen(forward, expected, signal, unsure), onward=expected,
                        wait=max(before.wait - 1, 0))
        if fits(touch, unsure):
            return replace(touch, onward=touch.filter, waited=1, wait=0), _inversion(forward, touch.filter, unsure)
        if touch.wait:
            return touch, _inversion(forward, touch.filter, unsure)
    size, axes = principal(unsure.drift[:, unsure.kept])
    fewer = sought_by()
    assert isinstance(fewer, TouchInversion)
    found = invert(fewer.forward, signal[unsure.kept][None], float(np.hypot(unsure.noise_V, unsure.rest_V)),
                   Drift(axes.T, size))
    first = touch_filter.seen(forward, touch_filter.unseen(forward, unsure), signal, unsure, found.touch[0])
    again = Touch(first, first)
    if before is None or _misfit(again) < BETTER * _misfit(touch):
        return again, found
    waited = min(2 * touch.waited, MOST_WAITED)
    return replace(touch, wait=waited, waited=waited), _inversion(forward, touch.filter, unsure)


def _inversion(forward: ForwardMap, followed: Followed, unsure: Unsure) -> Inversion:
    """The touch, with the drift among what is noise and not the map's: it is as normal as it is believed."""
    shared = followed.shared.copy()
    shared[:, :, shared.shape[2] - len(unsure.drift):] = 0.0
    return followed_punch.inversion(forward, replace(followed, shared=shared))


def estimate(learner: TouchInversion, found: Inversion, scale: IntervalScale, normal: float) -> Estimate:
    """Outputs of a touch, whose standard deviations are such that intervals of `scale` of them hold their part: noise
    is as normal as it is believed, the map's error is calibrated. Where `scale` is 0, as of a diameter that all touches
    share, nothing is to be made of it."""
    plain = answered(learner, found)
    assert plain.parts is not None
    share = (plain.parts.noise / np.maximum(plain.sd, np.finfo(float).tiny)) ** 2
    calibrated = scale.of(plain.sd, plain.near_edge)
    over = np.divide(normal, calibrated, out=np.ones_like(calibrated), where=calibrated > 0)
    factor = np.sqrt(1 + (over**2 - 1) * share)
    return replace(plain, below=plain.below * factor, above=plain.above * factor)
