"""Frames in time, of a skin that is pressed, a recording, or lines that a device writes."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from io import BufferedIOBase
from typing import Any

import numpy as np

from surrogate.data.frame_rows import frames_as_they_come
from surrogate.live.controls import Controls, Latest
from surrogate.live.skins import Pressed, Skin
from touchcal.arrays import Array

RATE_HZ = 50.0  # frames a second of a skin that is pressed, and of recordings without a clock
LONGEST_S = 10.0  # longest pause of a recording that is kept to
S_PER_MIN = 60.0


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame, and what is known of it besides."""

    time_s: float  # s since the first one
    volts: Array  # (readings,) V
    true: Controls | None = None  # the press that made it; None where that is not known
    # of a simulated frame: its noise, and the untouched frame with the drift so far, V
    noise_V: float | None = None
    untouched_V: Array | None = None
    answers_ms: float | None = None  # when the browser sent the press that this is the first answer to, by its clock
    fields: dict[str, Any] = field(default_factory=dict)  # as of Pressed
    note: str = ""  # what is to be known of the frame


def pressed_moments(skin: Skin, latest: Latest, seed: int = 0) -> Iterator[Moment]:
    """Readings of a skin under the latest controls with white noise and linear drift of each reading: at once after
    new ones, RATE_HZ without.

    They go on for ever.
    """
    rng, start = np.random.default_rng(seed), time.perf_counter()
    slope, drift = rng.normal(size=len(skin.baseline_V)), np.zeros(len(skin.baseline_V))
    nothing = Pressed(np.zeros(len(skin.baseline_V)), {})
    due = before = start
    asked, answer = None, nothing
    while True:
        controls, new = latest.wait(due - time.perf_counter())
        now = time.perf_counter()
        due = max(due + 1 / RATE_HZ, now if not new else now + 1 / RATE_HZ)
        press = replace(controls, noise_mV=0.0, drift_mV_per_min=0.0, sent_ms=0.0)
        if press != asked:
            asked, answer = press, skin.pressed(controls) if controls.force_N > 0 else nothing
        drift, before = drift + slope * controls.drift_mV_per_min / 1e3 * (now - before) / S_PER_MIN, now
        untouched, noise_V = skin.baseline_V + drift, controls.noise_mV / 1e3
        noise = rng.normal(size=len(drift)) * noise_V
        yield Moment(now - start, untouched + answer.signal_V + noise, controls, noise_V, untouched,
                     controls.sent_ms if new else None, answer.fields, answer.problem)


def recorded_moments(volts: Array, time_s: Array | None, rate_hz: float = RATE_HZ) -> Iterator[Moment]:
    """Frames (n, readings) at their times (n,), or so many a second; pauses are LONGEST_S at most."""
    clock = np.arange(len(volts)) / rate_hz if time_s is None else time_s - time_s[0]
    pauses = np.minimum(np.diff(clock, prepend=clock[0]), LONGEST_S)
    start = time.perf_counter()
    for k, (frame, at) in enumerate(zip(volts, np.cumsum(pauses), strict=True), start=1):
        time.sleep(max(start + at - time.perf_counter(), 0.0))
        yield Moment(float(at), frame, note=f"frame {k} of {len(volts)}" if k < len(volts) else "the recording ended")


def streamed_moments(source: BufferedIOBase, readings: int) -> Iterator[Moment]:
    """Frames of lines as they come; a line that is no frame has a note, and readings that are not there. ValueError
    for a header of other names."""
    start = time.perf_counter()
    for read in frames_as_they_come(source, readings):
        for volts, problem in zip(read.volts, read.problem, strict=True):
            yield Moment(time.perf_counter() - start, volts, note=problem)
