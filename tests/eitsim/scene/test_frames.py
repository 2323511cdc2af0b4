"""Frames of voltages: what is written is read back, digit by digit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.imaging.images import images_of
from eitsim.scene.drive import read_out
from eitsim.scene.electrodes import Electrodes, among_all, present
from eitsim.scene.frames import column_order, read_frames, write_frames
from eitsim.scene.results import Readings
from eitsim.scene.scene import Scene
from touchcal.errors import InputFileError


def solved(seed: int, baseline_V: np.ndarray) -> Readings:
    signal = 1e-4 * np.random.default_rng(seed).normal(size=baseline_V.shape)
    return Readings(baseline_V + signal, baseline_V, signal, np.zeros((4, 4)), 0.0, 0.0, 0, 0.0)


@pytest.fixture
def frames() -> list[Readings]:
    baseline = np.random.default_rng(0).normal(size=(4, 3))
    return [solved(seed, baseline) for seed in (1, 2)]


def test_frames_come_back_with_all_digits_untouched_first(frames: list[Readings], tmp_path: Path) -> None:
    write_frames(tmp_path / "frames.csv", frames)
    read = read_frames(tmp_path / "frames.csv", 12)
    assert read.line.tolist() == [2, 3, 4]
    np.testing.assert_array_equal(read.volts[0], frames[0].baseline_V.ravel())
    np.testing.assert_array_equal(read.volts[1:], [frame.touched_V.ravel() for frame in frames])
    assert (tmp_path / "frames.csv").read_text().startswith("v_000,v_001,v_002,")


def test_columns_are_found_by_name_and_blank_lines_left_out(frames: list[Readings], tmp_path: Path) -> None:
    write_frames(tmp_path / "frames.csv", frames)
    rows = [line.split(",")[::-1] for line in (tmp_path / "frames.csv").read_text().splitlines()]
    (tmp_path / "turned.csv").write_text("\n\n".join(",".join(row) for row in rows))
    read = read_frames(tmp_path / "turned.csv", 12)
    np.testing.assert_array_equal(read.volts, read_frames(tmp_path / "frames.csv", 12).volts)
    assert read.line.tolist() == [3, 5, 7]


def test_other_columns_of_a_recording_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "frames.csv").write_text("index,time_s,touch,v_001,v_000\n0,0.5,,2,1\n1,0.6,thumb,4,3\n")
    read = read_frames(tmp_path / "frames.csv", 2)
    assert (read.volts.tolist(), read.line.tolist()) == ([[1, 2], [3, 4]], [2, 3])


@pytest.mark.parametrize(("text", "message"), [
    ("1,2,3\n", "line 1: 3 columns, expected 2 voltages a row.* with a point"),
    ("1,2,3\n4,5,6\n", "It has 2 rows: are rows and columns exchanged"),
    ("1,2\n3\n", "line 2: 1 columns, expected 2 voltages a row"), ("a,b\n", "no rows of voltages"),
    ("v_000,volts\n1,2\n", "frames.csv: the header names 'volts' in column 2, which is no reading.* v_000 to v_001"),
    ("v_000,v_000\n1,2\n", "the header lacks v_001"),
    ("1,2\n3,inf\n", "line 2: column 2 holds 'inf'")])
def test_frames_that_cannot_be_are_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "frames.csv").write_text(text)
    with pytest.raises(InputFileError, match=message):
        read_frames(tmp_path / "frames.csv", 2)


def test_readings_of_a_missing_electrode_are_empty_cells(frames: list[Readings], tmp_path: Path) -> None:
    unread = np.arange(12) == 4
    holed = [replace(frame, touched_V=np.where(unread.reshape(4, 3), np.nan, frame.touched_V),
                     baseline_V=np.where(unread.reshape(4, 3), np.nan, frame.baseline_V)) for frame in frames]
    write_frames(tmp_path / "frames.csv", holed)
    whole = np.array([frame.touched_V.ravel() for frame in frames])
    read = read_frames(tmp_path / "frames.csv", 12)
    np.testing.assert_array_equal(read.volts[1:], np.where(unread, np.nan, whole))


def test_frames_of_a_ring_with_a_missing_electrode_are_imaged(tmp_path: Path) -> None:
    scene = Scene(electrodes=Electrodes(missing=(4,)))
    rim = solve_rim(scene.body, present(scene.electrodes), 1e-3).impedance_Ohm
    baseline, touched = (read_out(scene.drive, among_all(scene.electrodes, z)) for z in (rim, rim * (1 + 1e-3)))
    write_frames(tmp_path / "frames.csv", [Readings(touched, baseline, touched - baseline, rim, 0.0, 0.0, 0, 0.0)])
    images, fitted = images_of(tmp_path / "frames.csv", scene)
    assert np.isfinite(images.change).all()
    assert fitted["conductance_S"] == pytest.approx(1e-3, rel=1e-2)
    assert not images.cautions
    left_out, _ = images_of(tmp_path / "frames.csv", Scene())
    assert "of 208 readings are empty in a frame" in left_out.cautions[0]


def test_a_result_is_no_table_of_frames() -> None:
    with pytest.raises(ValueError, match=r"JSON; frames are rows of a CSV.*--frames FILE"):
        column_order(["{"], 208)


@pytest.mark.parametrize(("readings", "message"), [(2, "names 'ch3' in column 4, which is no reading"),
                                                   (4, "names 3 readings, 'ch1' to 'ch3', and 4 are expected")])
def test_a_header_of_a_word_of_its_own_is_named_as_it_stands(readings: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        column_order(["touch", "ch1", "ch2", "ch3"], readings)
