"""Several frames of one press: never in training and test at once, and counted once."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.labels import Labels, read_labels
from eitsim.sensors.recording import Recording
from surrogate.model.recorded.learn_presses import learn
from surrogate.recordings import press_reader
from surrogate.recordings.press_frames import press_of_frames
from surrogate.recordings.presses import Presses
from touchcal.arrays import Array

from .conftest import labels_at, short_networks, synthetic_places, synthetic_signal


def frames_of_presses(seed: int, presses: int, frames: int) -> tuple[Presses, Array]:
    """Presses whose patterns each differ from that of their place, which their frames share but for little noise."""
    rng = np.random.default_rng(seed)
    place = synthetic_places(rng, presses)
    signal = synthetic_signal(place, np.ones(presses))
    signal += 0.5 * np.abs(signal).mean() * rng.standard_normal(signal.shape)
    signal = np.repeat(signal, frames, axis=0)
    signal += 0.02 * np.abs(signal).mean() * rng.standard_normal(signal.shape)
    rows = np.arange(len(signal))
    return Presses(rows.astype(np.str_), rows, signal, np.full_like(signal, np.nan), np.zeros(len(rows)),
                   np.empty((0, signal.shape[1])), np.empty(0), rows.astype(float)), np.repeat(place, frames, axis=0)


def recorded(presses: Presses) -> Recording:
    return Recording(presses.signal, presses.index, None, presses.name, "difference", Path("synthetic.csv"))


@pytest.mark.slow
@pytest.mark.parametrize("named", ["frames", "presses", "column"])
@pytest.mark.parametrize("frames", [1, 2, 5])
def test_scores_agree_with_presses_held_back(frames: int, named: str) -> None:
    presses, place = frames_of_presses(1, 60, frames)
    number = np.repeat(np.arange(60), frames)
    labels = labels_at(place)
    if named == "presses":
        presses = replace(presses, name=number.astype(np.str_))
        labels = Labels(np.arange(60).astype(np.str_), labels.names, labels.values[::frames])
    elif named == "column":
        rng = np.random.default_rng(0)  # places as a camera would measure them, no two the same
        labels = replace(labels, values=labels.values + 1e-3 * rng.standard_normal(place.shape),
                         press=number.astype(np.str_))
    with short_networks():
        model = learn(recorded(presses), labels)
    new, there = frames_of_presses(2, 400, 1)
    found = press_reader.read(model.reader, new).place
    assert found
    held_back = np.linalg.norm(found.value - there, axis=1).mean()
    assert (model.presses, model.frames) == (60, 60 * frames)
    for one in (tested.score for tested in model.tested):
        assert (one.trained, one.tested, one.tested_frames) == (48, 12, 12 * frames)
        assert 0.7 < one.error / held_back < 1.6
    assert 0.75 < np.mean(np.abs(found.value - there) <= found.bounds.half_width) < 0.99


def tiny(name: list[str], rest_time: list[float], time: list[float]) -> Presses:
    count = len(name)
    signal = np.ones((count, 3))
    return Presses(np.array(name, dtype=np.str_), np.arange(count), signal, signal, np.zeros(count),
                   np.ones((len(rest_time), 3)), np.array(rest_time), np.array(time))


def test_frames_of_one_name_or_place_are_of_one_press() -> None:
    presses = tiny([*"aabcdea"], [], [0, 1, 2, 3, 4, 5, 6])
    labels = Labels(presses.name, ("x_mm", "y_mm"), np.array(
        [[0, 0], [0, 0], [1, 2], [1, 2], [1, 3], [1, 2], [0, 0]], float))
    assert press_of_frames(presses, labels).tolist() == [0, 0, 1, 1, 2, 3, 0]
    named = replace(labels, press=np.array(list("uvwwxxv")))
    assert press_of_frames(presses, named).tolist() == [0, 0, 1, 1, 2, 2, 0]


@pytest.mark.parametrize(("runs", "presses"), [(9, 18), (10, 10)])
def test_without_places_a_run_between_untouched_frames_is_a_press(runs: int, presses: int) -> None:
    time = np.arange(3.0 * runs)
    touched = time % 3 > 0
    frames = tiny([str(k) for k in range(2 * runs)], time[~touched].tolist(), time[touched].tolist())
    labels = Labels(frames.name, ("F_N",), np.arange(2.0 * runs)[:, None])
    assert press_of_frames(frames, labels).max() + 1 == presses


def test_presses_are_counted_where_they_are_too_few() -> None:
    presses, place = frames_of_presses(1, 9, 5)
    with pytest.raises(ValueError, match="9 labelled presses of 45 frames are too few"):
        press_reader.fit(presses, labels_at(place))


def test_a_column_names_the_press(tmp_path: Path) -> None:
    path = tmp_path / "touches.csv"
    path.write_text("touch,press,F_N\n1,a,0.5\n2,a,0.6\n3,b,0.7\n")
    labels = read_labels(path)
    assert labels.press is not None
    assert (labels.names, labels.press.tolist()) == (("F_N",), ["a", "a", "b"])
    path.write_text("touch,press\n1,a\n")
    with pytest.raises(ValueError, match="expected touch and any of"):
        read_labels(path)
    path.write_text("touch,press,F_N\n1,,0.5\n")
    with pytest.raises(ValueError, match="press is empty"):
        read_labels(path)
