"""Touches followed by a model of a sweep: on the map by the forward method, every frame alone by others."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from surrogate.data import outputs
from surrogate.data.baseline_frame import compared
from surrogate.data.dead_readings import SaidOnce, too_many
from surrogate.data.frame_drift import by_gain
from surrogate.data.reading_noise import ReadingNoise, white_noise
from surrogate.data.sensor_ring import Ring
from surrogate.data.untouched_stream import Background, error_after
from surrogate.forward_map.inversion.touch_filter import Unsure
from surrogate.learners.base import Learner
from surrogate.learners.forward import TouchInversion
from surrogate.learners.novelty import fit_novelty, reciprocal
from surrogate.model.missing_channels import cost_words, of_fewer, silent
from surrogate.model.predict import WEAK, Predictions, Predictor, columns, judged, numbers_of, predict, prepare
from surrogate.model.tracking import follow_by_map
from surrogate.model.tracking.contact import patterns_of
from surrogate.model.tracking.follow_by_map import Touch
from surrogate.model.tracking.followed_reading import TOO_WEAK, Read, unread
from surrogate.model.tracking.tracked import SEVERAL_TOUCHES, TOUCH
from surrogate.model.trained import TrainedModel
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array, Mask

KEPT = 8  # sets of dead channels, the latest, whose preparation is kept: where channels flicker, each frame has its own
_SI = np.array([1e-3, 1e-3, 1e-3, 1.0])  # of x, y, d in mm and F in N


def _by_gain(model: TrainedModel) -> Array:
    """(channels, readings) changes of the untouched frame by the channels' gains; none where they are not foreseen."""
    try:
        return by_gain(model.ring, model.baseline_V).T
    except ValueError:
        return np.zeros((0, len(model.baseline_V)))


@dataclass(frozen=True, eq=False)
class _Fewer:
    """What reads frames without some channels."""

    predictor: Predictor
    kept: Mask  # (readings,) channels that its frames have
    axes: Array  # (kept, m) orthonormal readings of symmetric impedances
    learner: Callable[[], Learner]  # the model's without the dead channels, made where a search needs it


def _fewer(whole: Predictor, dead: Mask) -> _Fewer:
    model, learner, kept = whole.model, whole.model.learner, ~dead
    axes = reciprocal(model.ring, kept)
    if not dead.any() or too_many(dead) or not isinstance(learner, TouchInversion):
        return _Fewer(whole, np.ones(len(dead), bool), axes, lambda: learner)
    fewer = of_fewer(model, dead)
    predictor = replace(whole, model=fewer, baseline_V=whole.baseline_V[kept], dead=np.zeros(int(kept.sum()), bool),
                        gains=whole.gains[kept], novelty=fit_novelty(fewer.ring, fewer.calibration.signal_V),
                        reduced={})
    return _Fewer(predictor, kept, axes, cache(lambda: learner.without(model.ring, fewer.ring, kept)))


class FollowedModel:
    """A model of a sweep and the touch that it follows."""

    def __init__(self, model: TrainedModel, scaling: str, held_s: float | None, say: Callable[[str], object]) -> None:
        self.readings, self.weakest = len(model.baseline_V), model.trained.weakest_V
        self.patterns = patterns_of(model.calibration.signal_V)
        self.columns = columns(model)[1:-1]
        self.ring: Ring | None = model.ring
        self.foreseen = _by_gain(model)
        self._model, self._scaling, self._held_s = model, scaling, held_s
        self._fewer: dict[bytes, _Fewer] = {}
        self._touch: Touch | None = None
        self._noise = white_noise(1.0, self.readings)
        self.lost = SaidOnce(lambda dead, columns: cost_words(model, dead, self._predictor.noise, columns), say)
        self._predictor = prepare(model, model.baseline_V, 0.0, held_s=held_s)
        # what a search keeps is made now, so that no frame waits for it
        across = np.argsort(np.linalg.norm(model.calibration.target[:, :2], axis=1))[[0, -1]]
        model.learner.estimate(model.calibration.signal_V[across], 0.0)

    def dead(self, volts: Array) -> Mask:
        """Channels that read nothing."""
        return silent(volts[None], self._model.baseline_V)[0]

    def why_not(self, dead: Mask) -> str:
        """Why these are needed."""
        return too_many(dead)

    def ended(self) -> None:
        """No touch is followed."""
        self._touch = None

    def with_noise(self, noise: ReadingNoise) -> None:
        """As `Following`."""
        if noise.rms_V:
            self._noise = noise.largest.times(1 / noise.rms_V)

    def ready(self, background: Background) -> tuple[Array, str]:
        """Compare the untouched frame; intervals of methods without a map are calibrated at its noise."""
        gain, words = self.compared(background)
        if not isinstance(self._model.learner, TouchInversion):
            noise = background.noise_V * float(np.sqrt(np.mean(gain**2)))
            self._predictor = prepare(self._model, self._model.baseline_V, noise, held_s=self._held_s)
        return gain, words

    def compared(self, background: Background) -> tuple[Array, str]:
        """The factors and words of `baseline_frame.compared`."""
        found = compared(self._model.baseline_V, self._model.ring, background.volts, background.noise_V, self._scaling)
        return found.gain, found.words

    def read(self, volts: Array, background: Background, since_s: float, since: int, step_s: float) -> Read:
        """The touch with one more frame."""
        dead = np.isnan(volts)
        fewer = self._without(dead)
        noise = self._noise.times(background.noise_V)
        predictor = replace(fewer.predictor, baseline_V=background.volts[fewer.kept], noise=noise.of(fewer.kept))
        signal = np.where(dead, 0.0, volts - background.volts)
        if signal @ signal - (~dead).sum() * background.noise_V**2 < (WEAK * predictor.model.trained.weakest_V) ** 2:
            self._touch = None
            return unread(TOUCH, TOO_WEAK)
        learner = self._model.learner
        if not isinstance(learner, TouchInversion):
            return self._told(TOUCH, predict(predictor, volts[None]), np.eye(outputs.TOUCH))
        variance, root = error_after(background, since_s)
        unsure = Unsure(noise.white_V, math.sqrt(variance), np.concatenate([root, noise.root.T]), ~dead, fewer.axes,
                        noise.root.shape[1])
        self._touch, found = follow_by_map.follow(learner, fewer.learner, self._touch, signal, unsure, step_s)
        read = judged(predictor, volts[None, ~dead],
                      lambda _: follow_by_map.estimate(learner, found, predictor.scale, normal(COVERAGE)))
        more = follow_by_map.several(learner.forward, self._touch, signal, unsure)
        return self._told(SEVERAL_TOUCHES if more else TOUCH, read, found.covariance[0])

    def _without(self, dead: Mask) -> _Fewer:
        """What reads frames that lack these channels; intervals keep the scale of those with all channels."""
        key = dead.tobytes()
        found = self._fewer.pop(key, None) or _fewer(self._predictor, dead)
        if len(self._fewer) == KEPT:
            del self._fewer[next(iter(self._fewer))]
        self._fewer[key] = found
        return found

    def _told(self, state: str, read: Predictions, covariance: Array) -> Read:
        places = np.array([self._model.names.index(name) if name in self._model.names else -1
                            for name in outputs.TOUCHES])

        def of_touch(part: Array) -> Array:
            return np.where(places < 0, np.nan, part[0, places]) * _SI

        below, above = of_touch(read.below), of_touch(read.above)
        sd = (below + above) / 2 / normal(COVERAGE)
        own = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
        return Read(state, of_touch(read.value), covariance / np.outer(own, own) * np.outer(sd, sd), below, above,
                    read.flag[0], numbers_of(self._model, read)[0], int(read.kinds[0]))
