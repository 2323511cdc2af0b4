"""Frames followed one by one: what touches now, where, how hard, and how surely."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from surrogate.data import untouched_stream
from surrogate.data.baseline_frame import untouched
from surrogate.data.dead_readings import Names
from surrogate.data.flags import Flag, in_words
from surrogate.data.untouched_stream import CALIBRATION, Background
from surrogate.model import sticking
from surrogate.model.missing_channels import named, stuck
from surrogate.model.model import Model
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.tracking import contact, noise_scatter
from surrogate.model.tracking.contact import Contact
from surrogate.model.tracking.followed_model import FollowedModel
from surrogate.model.tracking.followed_presses import FollowedPresses
from surrogate.model.tracking.followed_reading import Following, Read, unread
from surrogate.model.tracking.tracked import CALIBRATING, UNREADABLE, UNTOUCHED, Tracked
from touchcal.arrays import Array

WAIT = 2  # frames that must be untouched after one before it is followed as untouched
MOVED = 0.05  # part of the untouched frame by which a jump makes it another one, which is compared with the training's
_AGAIN = 3  # times that frames which move as a touch does are not taken for untouched ones
BELIEVED = 0.02  # part of the weakest training signal whose norm noise is taken as at least, a pattern


_Timed = tuple[Array, float]  # a frame and its time, s


class Tracker:
    """Follows the frames of one sensor: an untouched frame that drifts, contact, and the touch itself.

    Touches of the forward method are followed by a Kalman filter on its map, which begins with the search that
    `SweepModel.predict` makes: of the first frame of a touch both say the same. Other methods read every frame alone.

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
        As in `SweepModel.predict`.
    held_s : float, optional
        As in `SweepModel.predict`.
    say : callable, optional
        Takes what is to be known of the untouched frame, in words; a warning where left out.

    Raises
    ------
    ValueError
        For frames of another number of readings, or a noise that is no finite number from 0.

    Examples
    --------
    >>> tracker = surrogate.Tracker(surrogate.load("model"), baseline_V, noise_V=2e-4)
    >>> [tracker.update(frame_V).state for frame_V in frames_V[:3]]
    ['touch', 'touch', 'touch']
    """

    def __init__(self, model: Model, baseline_V: ArrayLike | None = None,
                 noise_V: float | None = None, *, rate_hz: float = 50.0, scale_baseline: str = "auto",
                 held_s: float | None = None, say: Callable[[str], object] = warnings.warn) -> None:
        if noise_V is not None and not 0 <= noise_V < math.inf:
            raise ValueError(f"the noise of one reading must be a finite number of volts from 0, got {noise_V:g}.")
        if not 0 < rate_hz < math.inf:
            raise ValueError(f"the rate must be a finite number of frames a second above 0, got {rate_hz:g}.")
        if held_s is not None and isinstance(model, PressModel):
            raise ValueError("a model of a recording knows no holding time; leave held_s out.")
        self._following: Following = (FollowedPresses(model, say) if isinstance(model, PressModel)
                                      else FollowedModel(model, scale_baseline, held_s, say))
        self.rate_hz, self._say, self._noise_V = rate_hz, say, noise_V
        self._gain = np.ones(self._following.readings)
        self._dead = np.zeros(self._following.readings, bool)
        self._runs = sticking.begun(self._following.readings)
        self._left = 1 if noise_V is not None else CALIBRATION
        self._background: Background | None = None
        self._rest_V: Array | None = None  # the untouched frame that was given, where it does not tell the noise
        self._again = _AGAIN
        self._contact = Contact(self._following.patterns, (BELIEVED * self._following.weakest) ** 2)
        self._scatter = noise_scatter.begun()
        self._waiting: list[_Timed] = []  # the latest untouched frames
        self._odd: _Timed | None = None  # the latest frame, where it is the first that nothing explains
        self._jumped = False  # whether the latest frames did, and moved the untouched one
        self._time_s, self._since = -1 / rate_hz, 0  # of the latest frame; frames since the latest untouched one
        if baseline_V is not None:
            self._from_baseline(np.asarray(baseline_V, np.float64))

    @property
    def readings(self) -> int:
        """Readings of a frame."""
        return self._following.readings

    @property
    def columns(self) -> list[str]:
        """Names of the values of `Tracked.row`."""
        return self._following.columns

    def named_by(self, columns: Names) -> None:
        """Words on dead channels name them by these columns, v_000 ... where they are empty."""
        self._following.lost.columns = columns

    @property
    def calibration(self) -> int:
        """Frames that tell the noise, where it is not stated."""
        return CALIBRATION

    @property
    def noise_V(self) -> float:
        """Standard deviation of one reading, V, as known so far; NaN before two frames."""
        return math.nan if self._background is None else self._background.noise_V

    def _from_baseline(self, frames: Array) -> None:
        frames = frames.reshape(1, -1) if frames.size == self.readings else np.atleast_2d(frames)
        if frames.ndim != 2 or frames.shape[1] != self.readings:
            raise ValueError(f"untouched frames of {frames.shape[-1]} readings; the trained sensor has "
                             f"{self.readings}.")
        self._dead = stuck(frames)
        for frame in frames:
            self._dead |= self._following.dead(frame)
        found = untouched(frames, self._following.ring)
        noise = self._noise_V
        if noise is None and found.noise_V is not None:
            noise = found.noise_V / math.sqrt(1 + 1 / len(frames))
        if noise is None:
            self._rest_V = found.volts
            self._background = untouched_stream.begun(found.volts, self._time_s, self._following.foreseen)
            return
        self._background = untouched_stream.known(found.volts, noise, len(frames), self._time_s,
                                                  self._following.foreseen)
        self._ready()
        if self._noise_V is None and found.noise is not None:
            shared = found.noise.scaled(self._gain)
            self._contact = contact.with_noise(self._contact, shared, self._background.noise)
            self._following.with_noise(shared)

    def _ready(self) -> None:
        """Compare the untouched frame with that of the training, once its noise is known."""
        assert self._background is not None
        self._left = 0
        self._scaled(*self._following.ready(self._background))

    def _scaled(self, gain: Array, words: str) -> None:
        assert self._background is not None
        self._gain = self._gain * gain
        self._background = untouched_stream.scaled(self._background, gain)
        self._waiting = [(volts * gain, time_s) for volts, time_s in self._waiting]
        self._scatter = noise_scatter.scaled(self._scatter, gain)
        self._compared_V = self._background.volts
        if words:
            self._say(words)

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
        before_s, self._time_s = self._time_s, self._time_s + 1 / self.rate_hz if time_s is None else time_s
        self._since += 1
        background = self._background
        self._runs = sticking.followed(self._runs, volts)
        dead = self._following.dead(volts) | self._dead | self._runs.sticking()
        if background is not None:
            dead |= np.isnan(background.volts)
        volts = np.where(dead, np.nan, volts) * self._gain
        if dead.any() and (problem := self._following.why_not(dead)):
            return self._told(unread(UNREADABLE, f"{named(dead)}; {problem}"))
        self._following.lost.met(dead)
        if background is None or self._left:
            return self._told(self._calibrated(background, volts))
        since_s = max(self._time_s - background.time_s, 0.0)
        signal = np.where(dead, 0.0, volts - background.volts)
        step_s = max(self._time_s - before_s, 0.0)
        self._contact = contact.met(self._contact, signal, ~dead, background, since_s, step_s)
        if self._contact.touched:
            self._background = background = untouched_stream.interrupted(background)
            self._waiting, self._odd, self._scatter = [], None, noise_scatter.interrupted(self._scatter)
            return self._told(self._following.read(volts, background, since_s, self._since, step_s), signal)
        self._following.ended()
        if not self._contact.against:
            self._since = 0
            self._followed((volts, self._time_s), self._contact.strange)
        kinds = Flag.OTHER_SIGN if self._contact.mirrored else Flag.DRIFTED if self._contact.strange else Flag(0)
        return self._told(unread(UNTOUCHED, in_words(kinds), kinds), signal)

    def _followed(self, frame: _Timed, strange: bool) -> None:
        """Follow the untouched frame by all that are untouched but the latest WAIT, which may be of a touch that only
        begins. A jump is followed from its second frame on: one frame alone was cut."""
        if strange and self._odd is None and not self._jumped:
            self._odd = frame
            return
        self._waiting += [frame] if self._odd is None or not strange else [self._odd, frame]
        self._odd = None
        while len(self._waiting) > (0 if strange else WAIT):
            assert self._background is not None
            volts, time_s = self._waiting.pop(0)
            self._background = untouched_stream.followed(self._background, volts, time_s)
            self._learn(volts)
        if self._jumped and not strange:
            self._compared_again()
        self._jumped = strange

    def _learn(self, volts: Array) -> None:
        """What one more untouched frame shows of the noise that readings share."""
        assert self._background is not None
        self._scatter, due = noise_scatter.with_frame(self._scatter, volts)
        if due and (found := noise_scatter.noise(self._scatter, self._background.volts, self._following.ring)):
            self._contact = contact.with_noise(self._contact, found, self._background.noise)

    def _compared_again(self) -> None:
        """Compare the untouched frame with that of the training again, where it is another one after a jump."""
        assert self._background is not None
        moved = np.nan_to_num(self._background.volts - self._compared_V)
        if np.linalg.norm(moved) > MOVED * np.linalg.norm(np.nan_to_num(self._compared_V)):
            self._scaled(*self._following.compared(self._background))

    def _calibrated(self, known: Background | None, volts: Array) -> Read:
        """One more frame of those that tell the noise, or the first untouched one where it is stated."""
        self._since = 0
        if self._noise_V is not None:
            self._background = untouched_stream.known(volts, self._noise_V, 1, self._time_s,
                                                      self._following.foreseen)
        elif known is None:
            self._background = untouched_stream.begun(volts, self._time_s, self._following.foreseen)
        else:
            self._background = untouched_stream.followed(known, volts, self._time_s)
        self._learn(volts)
        self._left -= 1
        if not self._left and self._noise_V is None:
            self._moved_meanwhile()
        if self._left:
            return unread(CALIBRATING, "")
        self._ready()
        return unread(UNTOUCHED, "")

    def _moved_meanwhile(self) -> None:
        """Learn the untouched frame again where the frames of it moved as a touch does, a few times."""
        moved_V = noise_scatter.moved(self._scatter)
        if moved_V < self._following.weakest or not moved_V:
            return
        if not self._again:
            self._say(f"the frames taken for untouched ones still move by {moved_V:.3g} V in norm; that counts as "
                      "noise, and weak touches are missed.")
            return
        if self._again == _AGAIN:
            self._say(f"the frames taken for untouched ones move by {moved_V:.3g} V in norm, as under a touch, so the "
                      "untouched frame is learnt again from the next ones: touch nothing.")
        self._again, self._left, self._scatter = self._again - 1, CALIBRATION, noise_scatter.begun()
        self._background = None if self._rest_V is None else untouched_stream.begun(
            self._rest_V, self._time_s, self._following.foreseen)

    def _told(self, read: Read, signal: Array | None = None) -> Tracked:
        signal = np.full(len(self._gain), np.nan) if signal is None else signal
        return Tracked(self._time_s, read.state, read.value, read.covariance, read.below, read.above, signal,
                       self.noise_V, self._left, read.flag, read.row, read.kinds)
