"""The untouched frame of a stream: its noise, its drift, and what a touch interrupts. Synthetic."""

import numpy as np
import pytest

from surrogate.data.untouched_stream import BLOCK, Background, begun, followed, interrupted, known
from touchcal.arrays import Array

READINGS, STEP_S = 60, 0.02


def watched(frames: Array) -> Background:
    known = begun(frames[0], 0.0)
    for number, frame in enumerate(frames[1:], start=1):
        known = followed(known, frame, number * STEP_S)
    return known


def test_noise_and_the_mean_are_learnt_from_still_frames() -> None:
    rng = np.random.default_rng(0)
    known = watched(1.0 + 1e-3 * rng.normal(size=(400, READINGS)))
    assert known.noise_V == pytest.approx(1e-3, rel=0.05)
    off = known.volts - 1.0
    assert np.mean(off**2) == pytest.approx(known.variance, rel=0.6)
    assert known.variance < 1e-6 / 100
    assert len(known.walk.root) == 0


def test_a_walk_along_one_direction_is_found_and_followed() -> None:
    rng = np.random.default_rng(1)
    way = rng.normal(size=READINGS)
    way /= np.linalg.norm(way)
    rate = 0.02  # V a root second
    walk = np.cumsum(rate * np.sqrt(STEP_S) * rng.normal(size=1000))
    frames = walk[:, None] * way + 1e-3 * rng.normal(size=(len(walk), READINGS))
    known = watched(frames)
    assert len(known.walk.root) == 1
    assert abs(known.walk.root[0] @ way) > 0.95 * np.linalg.norm(known.walk.root[0])
    assert 0.4 < np.linalg.norm(known.walk.root[0]) / rate < 2.0
    assert np.linalg.norm(known.volts - walk[-1] * way) < 0.02
    # a mean of all frames is far behind
    assert np.linalg.norm(frames.mean(axis=0) - walk[-1] * way) > 0.02


def test_a_touch_between_tells_no_noise_but_how_far_the_frame_went() -> None:
    rng = np.random.default_rng(2)
    known = watched(1e-3 * rng.normal(size=(2 * BLOCK, READINGS)))
    way = np.zeros(READINGS)
    way[:10] = 1.0
    for pause in range(1, 7):
        # one block and too few frames for another: what a pause alone shows of the walk is nothing
        begun_s, noise = known.time_s + 2.0, known.noise
        known = interrupted(known)
        for k in range(BLOCK + 3):
            known = followed(known, 0.02 * pause * way + 1e-3 * rng.normal(size=READINGS), begun_s + k * STEP_S)
            if k == 0:
                assert known.noise == noise
    assert known.noise_V == pytest.approx(1e-3, rel=0.1)
    assert len(known.walk.root) == 1
    assert np.linalg.norm(known.walk.root[0]) == pytest.approx(0.02 * np.sqrt(10 / 2.18), rel=0.2)


def test_a_dead_channel_tells_nothing() -> None:
    frames = 1.0 + 1e-3 * np.random.default_rng(3).normal(size=(100, READINGS))
    frames[:, 7] = np.nan
    known = watched(frames)
    assert known.noise_V == pytest.approx(1e-3, rel=0.1)
    assert np.isnan(known.volts[7])
    assert np.isfinite(np.delete(known.volts, 7)).all()


@pytest.mark.parametrize("frames", [1, 100])
def test_a_jump_tells_neither_noise_nor_walk(frames: int) -> None:
    """One frame that is cut, or another level from there on, each a thousand times as large as noise."""
    still_V = 1e-3 * np.random.default_rng(4).normal(size=(200, READINGS))
    off = still_V.copy()
    off[100:100 + frames] += np.sign(np.arange(READINGS) - 20.5)
    before, after = watched(still_V), watched(off)
    assert after.noise_V == pytest.approx(before.noise_V, rel=0.05)
    assert after.walk.trace < READINGS * 1e-6
    assert np.abs(after.volts - off[-1]).max() < 5e-3


def test_noise_that_grows_is_learnt() -> None:
    rng = np.random.default_rng(5)
    known = watched(1e-3 * np.where(np.arange(3000) < 300, 1, 10)[:, None] * rng.normal(size=(3000, READINGS)))
    assert known.noise_V == pytest.approx(1e-2, rel=0.1)


def test_frames_without_noise_that_jump_keep_the_untouched_frame_finite() -> None:
    jumped = followed(known(np.ones(READINGS), 0.0, 1, 0.0), np.full(READINGS, 0.5), STEP_S)
    assert jumped.volts == pytest.approx(0.5)
