"""Readings that a row holds a frame late, on synthetic presses whose rows begin in the middle of a scan."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.recording import Recording
from surrogate.recordings import networks, press_reader, touch_reader
from surrogate.recordings.ageing import learn_known
from surrogate.recordings.late_readings import late_readings, with_late
from surrogate.recordings.presses import Presses, presses_of
from surrogate.recordings.touch_reader import TouchReader
from touchcal.arrays import Array, Index

from .conftest import labels_at, synthetic_presses

LATE = np.arange(40)


def shifted(seed: int, count: int) -> tuple[Presses, Array]:
    """Presses whose first readings stand a row too low, read from a recording."""
    made, place = synthetic_presses(seed, count)
    rows = made.signal.copy()
    rows[1:, LATE] = made.signal[:-1, LATE]
    return presses_of(Recording(rows, np.arange(count), None, made.name, "difference", Path("shifted.csv"))), place


def late_in(presses: Presses, place: Array) -> Index:
    return late_readings(presses.signal, presses.following, place)


def test_late_readings_are_found_and_only_these() -> None:
    found = late_in(*shifted(1, 80))
    assert np.mean(np.isin(LATE, found)) > 0.7
    assert np.mean(np.isin(found, LATE)) > 0.9
    made, place = synthetic_presses(1, 80)
    inert = replace(made, following=np.roll(made.signal, -1, axis=0))
    assert len(late_in(inert, place)) <= 2


def test_a_frame_follows_only_where_its_index_is_one_more() -> None:
    frames = np.arange(8.0).reshape(4, 2)
    found = presses_of(Recording(frames, np.array([3, 4, 6, 7]), None, np.array(list("abcd")), "difference", Path("x")))
    np.testing.assert_array_equal(found.following, [[2, 3], [np.nan] * 2, [6, 7], [np.nan] * 2])
    np.testing.assert_array_equal(with_late(found.signal, found.following, np.array([1]))[0], [0, 1, 3])


def learnt(presses: Presses, place: Array) -> TouchReader:
    known = learn_known(presses, late_in(presses, place))
    return touch_reader.learn(presses, place, np.arange(len(place)), known, 0)[0]


@pytest.mark.slow
def test_late_readings_help_and_their_lack_widens_intervals_and_is_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(networks, "MOST_STEPS", 100)
    known, place = shifted(1, 80)
    reader = learnt(known, place)
    new, there = shifted(2, 100)
    lacking = replace(new, following=np.full_like(new.following, np.nan))
    whole, cut = touch_reader.read(reader, new), touch_reader.read(reader, lacking)
    unaware = learnt(replace(known, following=np.full_like(known.following, np.nan)), place)
    miss = [np.linalg.norm(one.value - there, axis=1).mean() for one in (whole, touch_reader.read(unaware, lacking))]
    assert miss[0] < 0.95 * miss[1]
    assert cut.bounds.half_width.mean() > whole.bounds.half_width.mean()
    assert np.mean(np.abs(cut.value - there) <= cut.bounds.half_width) > 0.85
    every = press_reader.fit(known, labels_at(place))
    assert all("frame that follows" in flag for flag in press_reader.read(every, lacking).flag)
    assert not any("frame that follows" in flag for flag in press_reader.read(every, new).flag[:-1])
    dead = np.isin(np.arange(new.signal.shape[1]), [3, 100])
    lost = replace(new, signal=np.where(dead, np.nan, new.signal), following=np.where(dead, np.nan, new.following))
    found, full = press_reader.read(every, lost), press_reader.read(every, new)
    assert not any("frame that follows" in flag for flag in found.flag[:-1])
    assert found.place
    assert full.place
    half = [one.place.bounds.half_width[:-1].mean() for one in (found, full) if one.place]
    assert half[0] < 1.3 * half[1]
    assert np.mean(np.abs(found.place.value - there) <= found.place.bounds.half_width) > 0.85
