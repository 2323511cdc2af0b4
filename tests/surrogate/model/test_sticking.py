from pathlib import Path

import numpy as np
import pandas as pd
import pytest

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
    stuck, first = frames.copy(), np.full(40, 200)
    first[[5, 7, 11, 13]] = 0, 80, 80, 4
    stuck[20:60, 3] = stuck[20, 3]  # and reads again
    stuck = np.where(np.arange(200)[:, None] >= first, stuck[np.minimum(first, 199), np.arange(40)], stuck)
    found = sticking.off(stuck)
    expected = np.where(np.arange(200)[:, None] >= first, np.nan, stuck)
    sure = abs(np.arange(200)[:, None] - first + 0.5) > 2  # by chance it may have had that value just before
    np.testing.assert_array_equal(found[sure], expected[sure])
    np.testing.assert_array_equal(sticking.off(frames), frames)


def touched_in_turn(seed: int) -> Array:
    """Frames in coarse steps that touches here and there change, as some channels rest for long in between."""
    rng = np.random.default_rng(seed)
    from_touch = (np.arange(40) - rng.integers(40, size=(600, 1))) % 40
    return np.round(100 + 0.3 * rng.standard_normal((600, 40)) + 20 * np.exp(-from_touch / 12))


def test_what_is_no_sticking() -> None:
    """Frames repeated whole, a channel that rarely changes, coarse steps, five channels of 40, and few steps."""
    frames = noisy(2)
    for other in (np.repeat(frames, 10, axis=0), np.concatenate([frames, np.tile(frames[-1], (30, 1))]),
                  noisy(3, 10_000, 2.0), touched_in_turn(4)):
        runs = sticking.begun(40)
        for frame in other:
            runs = sticking.followed(runs, frame)
            assert not runs.sticking().any()
    rarely, many, soon = frames.copy(), frames.copy(), frames[:8].copy()
    rarely[:, 5] = np.repeat(rarely[:3, 5], 20)
    many[20:, :5] = many[20, :5]
    soon[:, 5] = soon[0, 5]
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
@pytest.mark.parametrize("recorded", ["hydrogel/frames", "skin_plain/frames", "sixpoint/session1_frames",
                                      "sixpoint/session2_frames", "tank_moving/s1_diff"])
def test_recorded_channels_stick_only_where_they_are_made_to(recorded: str) -> None:
    """One from the first frame on, one from the 400th; none of the six-point recordings, whose steps are coarse."""
    table = pd.read_csv(REAL / f"{recorded}.csv")
    frames = table[[name for name in table if name.startswith("v_")] or [*table]].to_numpy(float)[:600]
    runs = sticking.begun(frames.shape[1])
    for frame in frames:
        runs = sticking.followed(runs, frame)
        assert not runs.sticking().any()
    stuck, at = frames.copy(), len(frames) * 2 // 3
    stuck[:, 10], stuck[at:, 50] = stuck[0, 10], stuck[at, 50]
    whole = np.isnan(sticking.off(stuck))
    assert whole[:, 10].all()
    if "sixpoint" not in recorded:
        assert whole[at:, 50].all()
        assert not np.delete(whole, [10, 50], axis=1).any()
