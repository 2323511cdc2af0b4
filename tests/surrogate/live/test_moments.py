"""Frames in time: pressed skins answer at once, recordings keep their rate, bad lines cost no other."""

import io
import itertools
import time

import numpy as np

from surrogate.live.controls import Controls, Latest
from surrogate.live.moments import RATE_HZ, pressed_moments, recorded_moments, streamed_moments
from surrogate.live.skins import Pressed
from touchcal.arrays import Array


class Skin:
    """Answers a press with its force on every reading."""

    baseline_V = np.full(4, 2.0)

    def pressed(self, controls: Controls) -> Pressed:
        return Pressed(np.full(4, controls.force_N), {})


def differences(latest: Latest, count: int) -> list[tuple[float, Array, float | None]]:
    moments = itertools.islice(pressed_moments(Skin(), latest), count)
    return [(one.time_s, one.volts - 2.0, one.answers_ms) for one in moments]


def test_a_press_is_in_the_next_frame_and_answered_once() -> None:
    latest = Latest(Controls(0.0, 0.0, 10.0))
    moments = pressed_moments(Skin(), latest)
    assert np.array_equal(next(moments).volts, np.full(4, 2.0))
    latest.set(Controls(0.0, 0.0, 10.0, 0.5, sent_ms=7.0))
    pressed, after = next(moments), next(moments)
    assert np.array_equal(pressed.volts, np.full(4, 2.5))
    assert (pressed.answers_ms, after.answers_ms) == (7.0, None)
    assert after.true is not None
    assert after.true.force_N == 0.5


def test_noise_and_drift_are_those_of_the_controls() -> None:
    found = differences(Latest(Controls(0.0, 0.0, 10.0, noise_mV=3.0)), 40)
    noise = np.array([difference for _, difference, _ in found])
    assert 2e-3 < noise.std() < 4e-3
    drifting = differences(Latest(Controls(0.0, 0.0, 10.0, drift_mV_per_min=60.0)), 12)
    (first, at, _), (last, end, _) = drifting[1], drifting[-1]
    rate = (end - at) / (last - first)
    assert np.allclose(rate, end / last, rtol=0.05)  # linear in time
    assert 1e-4 < np.abs(rate).max() < 1e-2  # about 1 mV a second


def test_frames_come_at_their_rate() -> None:
    begun = time.perf_counter()
    differences(Latest(Controls(0.0, 0.0, 10.0)), 11)
    assert time.perf_counter() - begun >= 10 / RATE_HZ - 1e-3
    begun = time.perf_counter()
    found = list(recorded_moments(np.zeros((4, 3)), np.array([5.0, 5.1, 5.2, 5.3])))
    assert time.perf_counter() - begun >= 0.3 - 1e-3
    assert [round(one.time_s, 6) for one in found] == [0.0, 0.1, 0.2, 0.3]
    assert found[-1].note == "the recording ended"


def test_a_line_that_is_no_frame_has_a_note_and_costs_no_other() -> None:
    lines = b"v_001,v_000\n1,2\noops\n\n3,\n"
    found = list(streamed_moments(io.BufferedReader(io.BytesIO(lines)), 2))
    assert [bool(one.note) for one in found] == [False, True, False]
    assert found[0].volts.tolist() == [2.0, 1.0]
    assert np.isnan(found[2].volts[0])
