"""Frames followed one by one: what touches now, where, how hard, and how surely."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from surrogate.data import outputs, untouched_stream
from surrogate.data.baseline_frame import compared, untouched
from surrogate.data.untouched_stream import CALIBRATION, Background
from surrogate.forward_map.inversion.touch_filter import Unsure
from surrogate.learners.forward import TouchInversion
from surrogate.learners.novelty import fit_novelty, reciprocal
from surrogate.learners.registry import METHODS
from surrogate.model import contact, follow_by_map
from surrogate.model.contact import Contact
from surrogate.model.follow_by_map import Touch
from surrogate.model.missing_channels import named, silent, stuck, why_not, without
from surrogate.model.predict import WEAK, Predictions, Predictor, judged, predict, prepare
from surrogate.model.tracked import CALIBRATING, SEVERAL_TOUCHES, TOUCH, UNREADABLE, UNTOUCHED, Tracked
from surrogate.model.trained import TrainedModel
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array, Mask

BELIEVED = 0.02  # part of the weakest training signal whose norm noise is taken as at least, a pattern
TOO_WEAK = "weaker than any trained touch"
SI_OF_TOUCH = np.array([1e-3, 1e-3, 1e-3, 1.0])


class Tracker:
    """Follows the frames of one sensor: an untouched frame that drifts, contact, and the touch itself.

    Touches of the forward method are followed by a Kalman filter on its map, which begins with the search that
    `Model.predict` makes: of the first frame of a touch both say the same. Other methods read every frame alone.

    Parameters
    ----------
    model : Model
    baseline_V : (readings,) or (k, readings), optional
        The untouched frame, V, or several, which tell the noise too. Without, the first frames are untouched ones.
    noise_V : float, optional
        Standard deviation of one reading, V, as stated or known from before: the tracker then answers from the first
        frame after an untouched one. Without, 20 frames tell it, which it says meanwhile.
    rate_hz : float
        Frames a second, for frames without a time.
    scale_baseline : "auto", "yes" or "no"
        As in `Model.predict`.
    held_s : float, optional
        As in `Model.predict`.
    say : callable, optional
        Takes what is to be known of the untouched frame, in words; a warning where left out.

    Raises
    ------
    ValueError
        For frames of another number of readings, or a noise that is no finite number from 0.

    Examples
    --------
    >>> tracker = surrogate.Tracker(model, noise_V=2e-4)                        # doctest: +SKIP
    >>> for frame_V in frames_V:                                                # doctest: +SKIP
    ...     now = tracker.update(frame_V)
    ...     print(now.state, now.value, now.ellipse)
    """

    def __init__(self, model: TrainedModel, baseline_V: ArrayLike | None = None, noise_V: float | None = None, *,
                 rate_hz: float = 50.0, scale_baseline: str = "auto", held_s: float | None = None,
                 say: Callable[[str], object] = warnings.warn) -> None:
        if noise_V is not None and not 0 <= noise_V < math.inf:
            raise ValueError(f"the noise of one reading must be a finite number of volts from 0, got {noise_V:g}.")
        if not 0 < rate_hz < math.inf:
            raise ValueError(f"the rate must be a finite number of frames a second above 0, got {rate_hz:g}.")
        self._model, self._rate_hz, self._say = model, rate_hz, say
        self._scaling, self._held_s, self._noise_V = scale_baseline, held_s, noise_V
        self._gain = np.ones(len(model.baseline_V))
        self._dead = np.zeros(len(model.baseline_V), bool)
        self._left = 0 if noise_V is not None else CALIBRATION
        self._background: Background | None = None
        self._predictor: Predictor | None = None
        self._fewer: dict[bytes, Predictor] = {}
        self._spans: dict[bytes, Array] = {}
        patterns = contact.patterns_of(model.calibration.signal_V)
        self._contact = Contact(patterns, (BELIEVED * model.trained.weakest_V) ** 2)
        self._touch: Touch | None = None
        self._time_s = -1 / rate_hz
        if baseline_V is not None:
            self._from_baseline(np.asarray(baseline_V, np.float64).reshape(-1, len(model.baseline_V)))

    def _from_baseline(self, frames: Array) -> None:
        self._dead = stuck(frames) | silent(frames, self._model.baseline_V).any(axis=0)
        found = untouched(frames)
        noise = self._noise_V
        if noise is None and found.noise_V is not None:
            noise = found.noise_V / math.sqrt(1 + 1 / len(frames))
        if noise is None:
            self._background = untouched_stream.begun(found.volts, 0.0)
            return
        self._background = untouched_stream.known(found.volts, noise, len(frames), 0.0)
        self._ready()

    def _ready(self) -> None:
        """Compare the untouched frame with that of the training, once its noise is known."""
        known, model = self._background, self._model
        assert known is not None
        self._left = 0
        found = compared(model.baseline_V, model.ring, known.volts, known.noise_V, self._scaling)
        if found.words:
            self._say(found.words)
        self._gain, self._background = found.gain, untouched_stream.scaled(known, found.gain)
        at = 0.0 if isinstance(model.learner, TouchInversion) else self._background.noise_V
        self._predictor = prepare(model, self._background.volts, at, self._dead, held_s=self._held_s)
        # what a search keeps is made now, and not when something touches
        across = np.argsort(np.linalg.norm(model.calibration.target[:, :2], axis=1))[[0, -1]]
        model.learner.estimate(model.calibration.signal_V[across], self._background.noise_V)

    def update(self, frame_V: ArrayLike, time_s: float | None = None) -> Tracked:
        """What one more frame says.

        Parameters
        ----------
        frame_V : (readings,) or (patterns, readings of one)
            Voltages, V, in the order of the sensor's protocol. NaN is a dead channel.
        time_s : float, optional
            Time of the frame, s, later than that of the one before; by the rate where left out.

        Returns
        -------
        Tracked

        Raises
        ------
        ValueError
            For another number of readings.
        """
        volts = np.asarray(frame_V, np.float64).ravel()
        if volts.size != len(self._gain):
            raise ValueError(f"a frame of {volts.size} readings; the trained sensor has {len(self._gain)}.")
        before_s, self._time_s = self._time_s, self._time_s + 1 / self._rate_hz if time_s is None else time_s
        volts = np.where(silent(volts[None], self._model.baseline_V)[0] | self._dead, np.nan, volts)
        dead = np.isnan(volts)
        if dead.any() and (problem := why_not(self._model, dead)):
            return self._nothing(UNREADABLE, f"{named(dead)}; {problem}")
        if self._predictor is None:
            return self._calibrated(volts)
        background = self._background
        assert background is not None
        volts = volts * self._gain
        signal = np.where(dead, 0.0, volts - background.volts)
        since_s = max(self._time_s - background.time_s, 0.0)
        self._contact = contact.met(self._contact, signal, background, since_s)
        if not self._contact.touched:
            self._touch = None
            if not self._contact.against:
                self._background = untouched_stream.followed(background, volts, self._time_s)
            return self._nothing(UNTOUCHED, named(dead) if dead.any() else "", signal)
        if background.last is not None:
            self._background = untouched_stream.interrupted(background)
        unsure = Unsure(background.noise_V, math.sqrt(background.variance), background.root * math.sqrt(since_s), ~dead,
                        self._axes(dead))
        return self._touched(volts, signal, unsure, max(self._time_s - before_s, 0.0))

    def _calibrated(self, volts: Array) -> Tracked:
        """One more frame of those that tell the noise, or the first untouched one where it is stated."""
        if self._noise_V is not None:
            self._background = untouched_stream.known(volts, self._noise_V, 1, self._time_s)
        elif self._background is None:
            self._background = untouched_stream.begun(volts, self._time_s)
        else:
            self._background = untouched_stream.followed(self._background, volts, self._time_s)
        self._left = max(self._left - 1, 0)
        if self._left:
            return self._nothing(CALIBRATING, "")
        self._ready()
        return self._nothing(UNTOUCHED, "")

    def _nothing(self, state: str, flag: str, signal: Array | None = None) -> Tracked:
        none, size = np.full(outputs.TOUCH, np.nan), len(self._gain)
        noise = self._background.noise_V if self._background is not None else math.nan
        return Tracked(self._time_s, state, none, np.full((outputs.TOUCH, outputs.TOUCH), np.nan), none, none,
                       np.full(size, np.nan) if signal is None else signal, noise, self._left, flag)

    def _touched(self, volts: Array, signal: Array, unsure: Unsure, step_s: float) -> Tracked:
        predictor, dead = self._for(~unsure.kept), ~unsure.kept
        size = math.sqrt(max(float(signal @ signal) - unsure.kept.sum() * unsure.noise_V**2, 0.0))
        if size < WEAK * predictor.model.trained.weakest_V:
            self._touch = None
            return self._nothing(TOUCH, TOO_WEAK, signal)
        learner = self._model.learner
        if not isinstance(learner, TouchInversion):
            return self._tracked(TOUCH, predict(predictor, volts[None]), None, signal)
        assert isinstance(predictor.model.learner, TouchInversion)
        self._touch, found = follow_by_map.follow(learner, predictor.model.learner, self._touch, signal, unsure, step_s)
        scale, at = predictor.scale, normal(COVERAGE)
        read = judged(predictor, volts[None, unsure.kept],
                      lambda _: follow_by_map.estimate(learner, found, scale, at))
        if dead.any():
            read = replace(read, flag=["; ".join(filter(None, (named(dead), read.flag[0])))])
        more = follow_by_map.several(learner.forward, self._touch, signal, unsure)
        return self._tracked(SEVERAL_TOUCHES if more else TOUCH, read, found.covariance[0], signal)

    def _for(self, dead: Mask) -> Predictor:
        """The predictor of frames that lack these channels, against the untouched frame as it is now."""
        assert self._predictor is not None
        assert self._background is not None
        now = replace(self._predictor, baseline_V=self._background.volts, noise_V=self._background.noise_V)
        if not dead.any() or not METHODS[self._model.method].handles_missing_channels:
            return now
        key = dead.tobytes()
        if key not in self._fewer:
            fewer = without(self._model, dead)
            self._fewer[key] = replace(self._predictor, model=fewer, dead=np.zeros(len(fewer.baseline_V), bool),
                                       novelty=fit_novelty(fewer.ring, fewer.calibration.signal_V), reduced={})
        return replace(self._fewer[key], baseline_V=now.baseline_V[~dead], noise_V=now.noise_V)

    def _axes(self, dead: Mask) -> Array:
        """(alive, m) orthonormal readings of symmetric impedances, without dead channels."""
        key = dead.tobytes()
        if key not in self._spans:
            self._spans[key] = reciprocal(self._model.ring, ~dead)
        return self._spans[key]

    def _tracked(self, state: str, read: Predictions, covariance: Array | None, signal: Array) -> Tracked:
        names = outputs.NAMES[:outputs.TOUCH]
        columns = [self._model.names.index(name) if name in self._model.names else -1 for name in names]

        def of_touch(part: Array) -> Array:
            return np.where(np.array(columns) < 0, np.nan, part[0, columns]) * SI_OF_TOUCH

        below, above = of_touch(read.below), of_touch(read.above)
        sd = (below + above) / 2 / normal(COVERAGE)
        if covariance is None:
            alike = np.eye(outputs.TOUCH)
        else:
            own = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
            alike = covariance / np.outer(own, own)
        assert self._background is not None
        return Tracked(self._time_s, state, of_touch(read.value), alike * np.outer(sd, sd), below, above, signal,
                       self._background.noise_V, 0, read.flag[0], read)
