"""What untouched frames teach where they share times, have dead channels, are few, or have another clock."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.recording import Recording
from surrogate.data import untouched_stream
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.recorded.reader_scores import read_rows
from surrogate.model.tracking.followed_presses import FollowedPresses
from surrogate.recordings import press_reader
from surrogate.recordings.ageing import learn_known
from surrogate.recordings.press_reader import PressReader
from surrogate.recordings.presses import Presses, presses_of
from touchcal.arrays import Array

from .conftest import labels_at, short_networks, synthetic_places, synthetic_signal

COUNT, NO_LATE = 60, np.zeros(0, np.intp)


@pytest.fixture(scope="module", autouse=True)
def quick() -> object:
    """Few, short networks: what is tested here does not depend on how well they learn."""
    with short_networks():
        yield


def recorded(step_s: float | None = 1.0, each: int = 1) -> tuple[Recording, Array]:
    """A synthetic recording of COUNT presses and their places, `each` drifting untouched frames before each; step_s:
    from a frame to the next, 0 within a press, or no clock."""
    rng = np.random.default_rng(4)
    place = synthetic_places(rng, COUNT)
    signal = synthetic_signal(place, np.ones(COUNT))
    size, frames = np.abs(signal).mean(), (each + 1) * COUNT
    axes = np.random.default_rng(99).standard_normal((2, signal.shape[1]))
    readings = 5 * size + 0.05 * size * np.cumsum(rng.standard_normal((frames, 2)), axis=0) @ axes
    pressed = np.arange(each, frames, each + 1)
    readings[pressed] += signal
    touch = np.full(frames, "", "U8")
    touch[pressed] = np.arange(COUNT)
    time_s = None if step_s is None else np.asarray(step_s * np.arange(frames), np.float64)
    return Recording(readings, np.arange(frames), time_s, touch, "voltage", Path("synthetic.csv")), place


def with_times(presses: Presses, time: Array, rest_time: Array) -> Presses:
    age = np.abs(time[:, None] - rest_time).min(axis=1)
    return replace(presses, time=time, rest_time=rest_time, age=age)


def test_ages_begin_at_the_step_of_time_where_untouched_frames_share_their_times() -> None:
    presses = presses_of(recorded(each=2)[0])
    when = np.arange(float(COUNT))
    known = learn_known(with_times(presses, when, np.repeat(when, 2)), NO_LATE)
    assert known.signals.greatest_age == 0
    assert [one.age for one in known.aged[:3]] == [2, 4, 8]


def test_untouched_frames_with_dead_channels_teach_no_drift_and_are_counted() -> None:
    recording, place = recorded()
    gappy = recording.readings.copy()
    gappy[[20, 22], 7] = np.nan
    presses = presses_of(replace(recording, readings=gappy))
    known = learn_known(presses, NO_LATE)
    assert len(known.aged)
    assert np.isfinite(known.signals.drift.root).all()
    assert all(np.isfinite(one.signal).all() for one in known.aged)
    reader = press_reader.fit(presses, labels_at(place))
    assert reader.place
    assert reader.left_out == ("2 of 60 untouched frames have dead channels: drift is learnt from the others.",)


def test_where_every_untouched_frame_lacks_a_channel_the_refusal_names_it() -> None:
    recording, place = recorded()
    gappy = recording.readings.copy()
    gappy[recording.touch == "", 7] = np.nan
    gappy[np.flatnonzero(recording.touch != "")[3], 11] = np.nan
    with pytest.raises(ValueError, match=r"^v_007 is dead in so many labelled presses that 0 of 60 have all readings; "
                                         r"10 or more must\. Leave"):
        press_reader.fit(presses_of(replace(recording, readings=gappy)), labels_at(place))


@pytest.fixture(scope="module")
def by_clock() -> PressReader:
    recording, place = recorded(0.02)
    return press_reader.fit(presses_of(recording), labels_at(place))


@pytest.fixture(scope="module")
def by_index() -> PressReader:
    recording, place = recorded(None)
    return press_reader.fit(presses_of(recording), labels_at(place))


def aged(recording: Recording) -> Recording:
    """Without all untouched frames but the first."""
    kept = np.flatnonzero((recording.touch != "") | (recording.index == 0))
    return replace(recording, readings=recording.readings[kept], index=recording.index[kept],
                   touch=recording.touch[kept],
                   time_s=None if recording.time_s is None else recording.time_s[kept])


def test_ages_in_seconds_are_not_compared_with_ages_in_frames(by_clock: PressReader, by_index: PressReader) -> None:
    clocked, frames = aged(recorded(0.02)[0]), aged(recorded(None)[0])
    of_frames, of_seconds = (PressModel(one, "voltage", COUNT, COUNT, 0, (), 0.0) for one in (by_index, by_clock))
    with pytest.raises(ValueError, match=r"synthetic.csv: it has no column time_s, and the model was trained"):
        of_seconds.predict(frames)
    read = [model.predict(one)["flag"].str.contains("older than any in training")
            for model, one in ((of_frames, frames), (of_frames, clocked), (of_seconds, clocked))]
    assert read[0].sum() > COUNT / 2
    assert all((one == read[0]).all() for one in read)


def test_a_stream_counts_frames_where_training_had_no_clock(by_clock: PressReader, by_index: PressReader) -> None:
    signal = synthetic_signal(np.array([[20.0, 10.0]]), np.ones(1))[0]
    background = untouched_stream.known(np.zeros(len(signal)), 1e-3, 1, 0.0)
    for since, old in ((1, False), (400, True)):
        read = [FollowedPresses(PressModel(one, "voltage", COUNT, COUNT, 0, (), 0.0), print).read(
            signal, background, 0.02 * since, since, 0.02).flag
                for one in (by_clock, by_index)]
        assert [("older than any" in flag) for flag in read] == [old, old]


def test_an_old_untouched_frame_is_flagged_where_training_had_too_few_to_learn_drift() -> None:
    recording, place = recorded(None)
    few = replace(recording, touch=np.where((recording.touch == "") & (recording.index > 2), "none", recording.touch))
    presses = presses_of(few)
    kept = np.flatnonzero(presses.name != "none")[:30]
    presses = replace(presses, name=presses.name[kept], index=presses.index[kept], signal=presses.signal[kept],
                      following=presses.following[kept], age=presses.age[kept], time=presses.time[kept])
    assert len(presses.rest) == 2
    reader = press_reader.fit(presses, labels_at(place[:30]))
    assert not any("older" in flag for flag in press_reader.read(reader, presses).flag)
    flag = press_reader.read(reader, replace(presses, age=np.full(30, 1e6))).flag
    assert all("so much that the intervals may not hold" in one for one in flag)


@pytest.mark.thorough
def test_scores_know_no_untouched_frame_after_the_last_training_press() -> None:
    recording, place = recorded(0.02)
    presses, rows = presses_of(recording), np.arange(COUNT)
    presses = replace(presses, age=np.where(rows < 50, presses.age, 1.0))  # tested ones are read by what drift spares
    other = presses.rest.copy()
    other[51:] *= 1 + np.random.default_rng(0).random(other[51:].shape)
    found = [read_rows(one, labels_at(place), rows[:50], rows[50:], "time", 0)[0]
             for one in (presses, replace(presses, rest=other))]
    np.testing.assert_array_equal(found[0].value, found[1].value)
    np.testing.assert_array_equal(found[0].half_width, found[1].half_width)
