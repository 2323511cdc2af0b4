from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.formats.open_file import open_recording
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model import sticking
from touchcal.arrays import Array

REAL = Path(__file__).parents[4] / "shared" / "real"


def noisy(seed: int, frames: int = 60, step: float = 0.0) -> Array:
    """Frames of 40 channels that drift and are read with noise, in whole steps where one is given."""
    rng = np.random.default_rng(seed)
    found = 100 + np.cumsum(0.1 * rng.standard_normal((frames, 40)), axis=0) + rng.standard_normal((frames, 40))
    return np.round(found / step) * step if step else found


@pytest.mark.parametrize("step", [0.0, 0.5])
def test_a_channel_is_off_from_where_it_sticks_to_the_end(step: float) -> None:
    frames = noisy(1, 200, step)
    stuck = frames.copy()
    stuck[80:, [7, 11]] = stuck[80, [7, 11]]
    stuck[20:60, 3] = stuck[20, 3]  # and reads again
    found = sticking.off(stuck)
    expected = np.where(np.isin(np.arange(40), (7, 11)) & (np.arange(200) >= 80)[:, None], np.nan, stuck)
    np.testing.assert_array_equal(found[82:], expected[82:])  # by chance it may have had that value just before
    np.testing.assert_array_equal(found[:78], expected[:78])
    np.testing.assert_array_equal(sticking.off(frames), frames)


def test_what_is_no_sticking() -> None:
    """Frames repeated whole, a channel that rarely changes, coarse steps, five channels of 40, and few steps."""
    frames = noisy(2)
    for other in (np.repeat(frames, 10, axis=0), np.concatenate([frames, np.tile(frames[-1], (30, 1))]),
                  noisy(3, 10_000, 2.0)):
        runs = sticking.begun(40)
        for frame in other:
            runs = sticking.followed(runs, frame)
            assert not runs.sticking().any()
    rarely, many, soon = frames.copy(), frames.copy(), frames.copy()
    rarely[:, 5] = np.repeat(rarely[:3, 5], 20)
    many[20:, :5] = many[20, :5]
    soon[4:, 5] = soon[4, 5]
    for other in (rarely, many, soon):
        np.testing.assert_array_equal(sticking.off(other), other)


def test_other_readings_say_how_often_a_channel_changes() -> None:
    frames = noisy(4, 6)
    frames[:, 5] = 1.0
    before = noisy(5, 80)
    assert np.isnan(sticking.off(frames, 0.1, sticking.usual(before))[:, 5]).all()
    before[:70, 5] = 1.0
    np.testing.assert_array_equal(sticking.off(frames, 0.1, sticking.usual(before)), frames)


@pytest.mark.skipif(not REAL.is_dir(), reason="recordings of others are not there")
@pytest.mark.parametrize("skin", ["hydrogel", "skin_plain"])
def test_recorded_channels_stick_only_where_they_are_made_to(skin: str) -> None:
    frames = np.asarray(open_recording(REAL / skin / "frames.csv", kind=read_sensor(REAL / skin / "sensor.toml").kind,
                                       readings=192).readings, float)[:600]
    np.testing.assert_array_equal(sticking.off(frames), frames)
    stuck = frames.copy()
    stuck[400:, 100] = stuck[400, 100]
    np.testing.assert_array_equal(np.isnan(sticking.off(stuck)).sum(axis=0), 200 * (np.arange(192) == 100))
