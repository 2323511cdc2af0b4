"""What there is to show: a skin that is pressed, a recording, or what a device writes."""

from collections.abc import Iterator
from dataclasses import replace
from io import BufferedIOBase
from pathlib import Path

import numpy as np

from eitsim.sensors.formats.open_file import open_recording
from surrogate.live.controls import Controls, Latest, Limits
from surrogate.live.marked_presses import marked_reader, marks_presses
from surrogate.live.messages import hello
from surrogate.live.moments import RATE_HZ, Moment, pressed_moments, recorded_moments, streamed_moments
from surrogate.live.pictured import pictured
from surrogate.live.reading import reader_of
from surrogate.live.serve import Show
from surrogate.live.skins import LearnedSkin, Skin, limits_of, usual_noise_V
from surrogate.model.model import Model
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.sweep_model import SweepModel
from touchcal.arrays import Array


def pressed_show(model: SweepModel, skin: Skin, noise_V: float | None = None) -> Show:
    """A skin that is pressed on the page, with this noise to begin with, V; the usual one where it is not given."""
    limits = limits_of(model)
    noise = usual_noise_V(model) if noise_V is None else noise_V
    limits = replace(limits, noise_mV=max(limits.noise_mV, noise * 1e3))
    diameter = limits.diameters_mm[len(limits.diameters_mm) // 2]
    latest = Latest(Controls(*limits.start_mm, diameter, noise_mV=noise * 1e3))
    source = "learned" if isinstance(skin, LearnedSkin) else "simulated"
    first = skin.pressed(replace(latest.wait(0.0)[0], force_N=limits.force_N / 2))
    read = reader_of(model, skin.baseline_V, noise, [])
    read(Moment(0.0, skin.baseline_V + first.signal_V))  # what is compiled and tabled at the first press
    return _show(model, skin.baseline_V, noise, pressed_moments(skin, latest), source, limits, latest)


def recorded_show(model: Model, path: Path, untouched_V: Array | None = None,
                  noise_V: float | None = None, rate_hz: float | None = None) -> Show:
    """A recording at its rate, or at this one where it has no clock.

    A model of a recording reads presses that the recording marks as its table does. Else a tracker follows the frames;
    the untouched ones are those given, else those that the recording marks, else its first ones. InputFileError where
    it cannot be read; ValueError for a rate next to a clock.
    """
    recording = open_recording(path, kind=model.kind, readings=pictured(model).readings)
    if rate_hz is not None and recording.time_s is not None:
        raise ValueError(f"{path} has a clock, time_s, so that `rate` would have no effect. Leave it out.")
    frames = np.asarray(recording.readings, np.float64)
    moments, marked = recorded_moments(frames, recording.time_s, rate_hz or RATE_HZ), marks_presses(recording)
    if marked and untouched_V is None and noise_V is None and isinstance(model, PressModel):
        said: list[str] = []
        return Show(hello(model, None, "recorded"), moments, marked_reader(model, recording, said.append), said)
    if untouched_V is None and marked and recording.untouched.any():
        untouched_V = frames[recording.untouched]
    return _show(model, untouched_V, noise_V, moments, "recorded")


def streamed_show(model: Model, source: BufferedIOBase, untouched_V: Array | None = None,
                  noise_V: float | None = None) -> Show:
    """Lines of frames as they come, the first ones untouched where none are given."""
    return _show(model, untouched_V, noise_V, streamed_moments(source, pictured(model).readings), "streamed")


def _show(model: Model, untouched_V: Array | None, noise_V: float | None,
          moments: Iterator[Moment], source: str, limits: Limits | None = None, latest: Latest | None = None) -> Show:
    cautions: list[str] = []
    read = reader_of(model, untouched_V, noise_V, cautions)
    return Show(hello(model, limits, source, noise_V or 0.0), moments, read, cautions, limits, latest)
