"""What there is to show: a skin that is pressed, a recording, or what a device writes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from io import BufferedIOBase
from itertools import chain
from pathlib import Path

import numpy as np

from eitsim.sensors.recording import Recording, read_recording
from surrogate.data.baseline_frame import Untouched, compared, untouched
from surrogate.data.frame_rows import read_lines
from surrogate.live.controls import Controls, Latest, Limits
from surrogate.live.messages import hello
from surrogate.live.moments import Moment, pressed_moments, recorded_moments, streamed_moments
from surrogate.live.reading import reader_of
from surrogate.live.serve import Show
from surrogate.live.skins import LearnedSkin, Skin, limits_of
from surrogate.model.predict import prepare
from surrogate.model.trained import TrainedModel
from touchcal.arrays import Array
from touchcal.errors import InputFileError


def pressed_show(model: TrainedModel, skin: Skin, noise_V: float = 0.0) -> Show:
    """A skin that is pressed on the page; noise_V is what the intervals count, V."""
    limits = limits_of(model)
    latest = Latest(Controls(0.0, 0.0, limits.diameters_mm[len(limits.diameters_mm) // 2], noise_mV=noise_V * 1e3))
    source = "learned" if isinstance(skin, LearnedSkin) else "simulated"
    skin.pressed(replace(latest.wait(0.0)[0], force_N=limits.force_N / 2))  # what is compiled at the first press
    return _show(model, skin.baseline_V, noise_V, pressed_moments(skin, latest), source, limits, latest)


def recorded_show(model: TrainedModel, path: Path, untouched_V: Array | None = None, noise_V: float = 0.0) -> Show:
    """A recording at its rate; its untouched frame is the one given, the mean of its untouched frames where it names
    touches, else the first one. InputFileError where it cannot be read."""
    recording = read_recording(path, readings=len(model.baseline_V))
    baseline = _untouched(recording) if untouched_V is None else untouched_V
    return _show(model, baseline, noise_V, recorded_moments(recording.readings, recording.time_s), "recorded")


def streamed_show(model: TrainedModel, source: BufferedIOBase, untouched_V: Array | None = None,
                  noise_V: float = 0.0) -> Show:
    """Lines of frames as they come, the first one untouched where none is given; ValueError where there is none."""
    moments = streamed_moments(source, len(model.baseline_V))
    first = next(moments, None)
    if first is None or first.note:
        raise ValueError("standard input begins with no frame" + (f": {first.note}." if first else ".")
                         + " Write the untouched frame first.")
    return _show(model, first.volts if untouched_V is None else untouched_V, noise_V, chain([first], moments),
                 "streamed")


def read_untouched(path: Path, readings: int) -> Untouched:
    """The untouched frame of a file of such frames; InputFileError where a line of it is no frame."""
    read = read_lines(path, readings)
    if bad := next((k for k, problem in enumerate(read.problem) if problem), None):
        raise InputFileError(path, f"{read.problem[bad]}. Fix it, or leave the line out.", line=int(read.line[bad]))
    return untouched(read.volts)


def _untouched(recording: Recording) -> Array:
    named = bool((recording.touch != "").any())
    return np.asarray(recording.readings[recording.untouched].mean(axis=0) if named and recording.untouched.any()
                      else recording.readings[0], np.float64)


def _show(model: TrainedModel, baseline_V: Array, noise_V: float, moments: Iterator[Moment], source: str,
          limits: Limits | None = None, latest: Latest | None = None) -> Show:
    found = compared(model.baseline_V, model.ring, baseline_V, noise_V)
    read = reader_of(prepare(model, baseline_V * found.gain, noise_V * found.noise_factor))
    scaled = (replace(moment, volts=moment.volts * found.gain) for moment in moments)
    return Show(hello(model, limits, source) | {"caution": found.words}, scaled, read, baseline_V * found.gain, limits,
                latest)
