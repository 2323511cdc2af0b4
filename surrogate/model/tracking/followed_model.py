"""Touches followed by a model of a sweep: on the map by the forward method, every frame alone by others."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from surrogate.data import outputs
from surrogate.data.baseline_frame import compared
from surrogate.data.frame_drift import by_gain
from surrogate.data.untouched_stream import Background, error_after
from surrogate.forward_map.inversion.touch_filter import Unsure
from surrogate.learners.forward import TouchInversion
from surrogate.learners.novelty import fit_novelty, reciprocal
from surrogate.model.missing_channels import named, silent, why_not, without
from surrogate.model.predict import WEAK, Predictions, Predictor, judged, numbers_of, predict, prepare
from surrogate.model.tracking import follow_by_map
from surrogate.model.tracking.contact import patterns_of
from surrogate.model.tracking.follow_by_map import Touch
from surrogate.model.tracking.followed_reading import TOO_WEAK, Read, unread
from surrogate.model.tracking.tracked import SEVERAL_TOUCHES, TOUCH
from surrogate.model.trained import TrainedModel
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array, Mask

_SI = np.array([1e-3, 1e-3, 1e-3, 1.0])  # of x, y, d in mm and F in N


def _by_gain(model: TrainedModel) -> Array:
    """(channels, readings) changes of the untouched frame by the channels' gains; none where they are not foreseen."""
    try:
        return by_gain(model.ring, model.baseline_V).T
    except ValueError:
        return np.zeros((0, len(model.baseline_V)))


class FollowedModel:
    """A model of a sweep and the touch that it follows."""

    def __init__(self, model: TrainedModel, scaling: str, held_s: float | None) -> None:
        self.readings, self.weakest = len(model.baseline_V), model.trained.weakest_V
        self.patterns = patterns_of(model.calibration.signal_V)
        self.foreseen = _by_gain(model)
        self._model, self._scaling, self._held_s = model, scaling, held_s
        self._fewer: dict[bytes, tuple[Predictor, Array]] = {}
        self._touch: Touch | None = None
        self._predictor = prepare(model, model.baseline_V, 0.0, held_s=held_s)
        # what a search keeps is made now, so that no frame waits for it
        across = np.argsort(np.linalg.norm(model.calibration.target[:, :2], axis=1))[[0, -1]]
        model.learner.estimate(model.calibration.signal_V[across], 0.0)

    def dead(self, volts: Array) -> Mask:
        """Channels that read nothing."""
        return silent(volts[None], self._model.baseline_V)[0]

    def why_not(self, dead: Mask) -> str:
        """Why these are needed."""
        return why_not(self._model, dead)

    def ended(self) -> None:
        """No touch is followed."""
        self._touch = None

    def ready(self, background: Background) -> tuple[Array, str]:
        """Compare the untouched frame; intervals of methods without a map are calibrated at its noise."""
        model = self._model
        found = compared(model.baseline_V, model.ring, background.volts, background.noise_V, self._scaling)
        if not isinstance(model.learner, TouchInversion):
            noise = background.noise_V * found.noise_factor
            self._predictor = prepare(model, model.baseline_V, noise, held_s=self._held_s)
        return found.gain, found.words

    def read(self, volts: Array, background: Background, since_s: float, since: int, step_s: float) -> Read:
        """The touch with one more frame."""
        dead = np.isnan(volts)
        predictor, axes = self._without(dead, background)
        signal, noise = np.where(dead, 0.0, volts - background.volts), background.noise_V
        if signal @ signal - (~dead).sum() * noise**2 < (WEAK * predictor.model.trained.weakest_V) ** 2:
            self._touch = None
            return unread(TOUCH, TOO_WEAK)
        learner, fewer = self._model.learner, predictor.model.learner
        if not isinstance(learner, TouchInversion) or not isinstance(fewer, TouchInversion):
            return self._told(TOUCH, predict(predictor, volts[None]), np.eye(outputs.TOUCH))
        variance, root = error_after(background, since_s)
        unsure = Unsure(noise, math.sqrt(variance), root, ~dead, axes)
        self._touch, found = follow_by_map.follow(learner, fewer, self._touch, signal, unsure, step_s)
        read = judged(predictor, volts[None, ~dead],
                      lambda _: follow_by_map.estimate(learner, found, predictor.scale, normal(COVERAGE)))
        if dead.any():
            read = replace(read, flag=["; ".join(filter(None, (named(dead), read.flag[0])))])
        more = follow_by_map.several(learner.forward, self._touch, signal, unsure)
        return self._told(SEVERAL_TOUCHES if more else TOUCH, read, found.covariance[0])

    def _without(self, dead: Mask, background: Background) -> tuple[Predictor, Array]:
        """The predictor of frames that lack these channels, against the untouched frame as it is now, and (alive, m)
        orthonormal readings of symmetric impedances. Intervals keep the scale of those with all channels."""
        key, model = dead.tobytes(), self._model
        if key not in self._fewer:
            fewer = without(model, dead) if dead.any() and not why_not(model, dead) else model
            self._fewer[key] = (replace(self._predictor, model=fewer, dead=np.zeros(len(fewer.baseline_V), bool),
                                        novelty=fit_novelty(fewer.ring, fewer.calibration.signal_V), reduced={}),
                                reciprocal(model.ring, ~dead))
        predictor, axes = self._fewer[key]
        kept = ~dead if len(predictor.model.baseline_V) < len(dead) else np.ones(len(dead), bool)
        return replace(predictor, baseline_V=background.volts[kept], noise_V=background.noise_V), axes

    def _told(self, state: str, read: Predictions, covariance: Array) -> Read:
        columns = np.array([self._model.names.index(name) if name in self._model.names else -1
                            for name in outputs.NAMES[:outputs.TOUCH]])

        def of_touch(part: Array) -> Array:
            return np.where(columns < 0, np.nan, part[0, columns]) * _SI

        below, above = of_touch(read.below), of_touch(read.above)
        sd = (below + above) / 2 / normal(COVERAGE)
        own = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
        return Read(state, of_touch(read.value), covariance / np.outer(own, own) * np.outer(sd, sd), below, above,
                    read.flag[0], numbers_of(self._model, read)[0])
