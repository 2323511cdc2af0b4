"""Touch or drift: what each explains of a frame decides, and the state before. Synthetic."""

from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.baseline_walk import Walk
from surrogate.data.untouched_stream import Background, known
from surrogate.model.tracking.contact import Contact, met, patterns_of
from touchcal.arrays import Array

READINGS, STEP_S = 100, 0.02
RNG = np.random.default_rng(6)
PATTERNS = patterns_of(RNG.normal(size=(30, READINGS)))
THERE = np.ones(READINGS, bool)
NOISE: Array = np.random.default_rng(7).normal(size=READINGS)
BACKGROUND = known(np.zeros(READINGS), 1.0, np.inf, 0.0)


def after(signal: Array, background: Background = BACKGROUND, frames: int = 2, *, touched: bool = False) -> Contact:
    contact = Contact(PATTERNS, 0.0, touched=touched)
    for _ in range(frames):
        contact = met(contact, signal + NOISE, THERE, background, STEP_S, STEP_S)
    return contact


def test_a_touch_is_found_and_noise_is_none() -> None:
    assert not after(np.zeros(READINGS)).touched
    assert after(8 * PATTERNS[3]).touched
    assert after(30 * PATTERNS[3], frames=1).touched


def test_no_touch_explains_a_large_drift() -> None:
    """Along a pattern the drift is far larger than noise, and a twentieth of the whole."""
    way = RNG.normal(size=READINGS)
    drift = 100 * (way / np.linalg.norm(way) + 0.2 * PATTERNS[0])
    contact = after(drift)
    assert not contact.touched
    assert contact.strange
    assert not contact.mirrored
    assert not after(drift, touched=True).touched


def test_half_of_a_frame_is_a_touch_whatever_the_rest() -> None:
    """Another punch, or a second touch."""
    assert after(100 * (PATTERNS[0] + PATTERNS[1])).touched


def test_a_touch_of_the_other_sign_is_none() -> None:
    contact = after(-30 * PATTERNS[3])
    assert not contact.touched
    assert contact.mirrored


def test_a_known_drift_is_no_touch_though_it_looks_like_one() -> None:
    drifting = replace(BACKGROUND, walk=Walk(60 * PATTERNS[:1], 0.0))
    assert after(9 * PATTERNS[0]).touched
    assert not after(9 * PATTERNS[0], drifting).touched
    assert after(9 * PATTERNS[5], drifting).touched


@pytest.mark.parametrize("touched", [False, True])
def test_what_is_in_doubt_stays_as_it_is(touched: bool) -> None:
    along = float(PATTERNS[3] @ NOISE)
    assert after((5.0 - along) * PATTERNS[3], touched=touched).touched == touched
