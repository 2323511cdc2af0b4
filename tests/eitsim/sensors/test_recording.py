"""Recordings: what the columns say is what is read; what is no recording is refused with its line and the fix."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.recording import read_recording
from eitsim.sensors.sensor_file import pairs_of, read_sensor
from touchcal.errors import InputFileError

REAL = Path(__file__).parents[4] / "shared" / "real"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "frames.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_come_back_with_dead_channels_as_nan(tmp_path: Path) -> None:
    path = written(tmp_path, "index,time_s,touch,v_000,v_001\n3,0.5,,1.5,\n7,0.75,a,2.5,-4e-3\n")
    found = read_recording(path, readings=2)
    np.testing.assert_array_equal(found.readings, [[1.5, np.nan], [2.5, -4e-3]])
    assert found.index.tolist() == [3, 7]
    assert found.time_s is not None
    assert found.time_s.tolist() == [0.5, 0.75]
    assert found.touch.tolist() == ["", "a"]
    assert found.untouched.tolist() == [True, False]
    assert (found.kind, found.source) == ("voltage", path)


def test_without_header_all_columns_are_readings_of_untouched_frames(tmp_path: Path) -> None:
    found = read_recording(written(tmp_path, "1,2,3\n4,5,6\n"), kind="magnitude")
    assert found.readings.shape == (2, 3)
    assert found.index.tolist() == [0, 1]
    assert found.time_s is None
    assert found.untouched.all()


@pytest.mark.parametrize("header", ["touch,ch1,ch2,ch3", "touch,R0,R1,R2", "touch,sensor 01,sensor 02,sensor 03"])
def test_readings_may_be_numbered_under_a_word_of_their_own(tmp_path: Path, header: str) -> None:
    (tmp_path / "frames.csv").write_text(f"{header}\n,1,2,3\n")
    found = read_recording(tmp_path / "frames.csv")
    np.testing.assert_array_equal(found.readings, [[1, 2, 3]])
    assert found.columns == tuple(header.split(",")[1:])
    assert not read_recording(written(tmp_path, "touch,v_000,v_001\n,1,2\n")).columns
    assert not read_recording(written(tmp_path, "1,2\n3,4\n")).columns


def test_a_touch_that_a_table_wrote_as_a_decimal_number_is_that_number(tmp_path: Path) -> None:
    found = read_recording(written(tmp_path, "touch,v_000\n,1\n0.0,2\n12.00,3\n1.50,4\nv1.0,5\n"))
    assert found.touch.tolist() == ["", "0", "12", "1.50", "v1.0"]


def test_frames_of_differences_are_never_untouched(tmp_path: Path) -> None:
    assert not read_recording(written(tmp_path, "v_000\n1\n2\n"), kind="difference").untouched.any()


@pytest.mark.parametrize(("text", "words"), [
    ("", "empty"),
    ("v_000,v_001\n", "without frames"),
    ("touch\na\n", "names no readings"),
    ("t,v_000\n0,1\n", "line 1: the header names 't'"),
    ("v_000,v_002\n1,2\n", "line 1: the header names 'v_002' where reading 1"),
    ("v_000,v_000\n1,2\n", "line 1: the header names 'v_000' where reading 1"),
    ("touch,v_001,v_002\n,1,2\n", "line 1: the header begins at 'v_001', and readings count from 0"),
    ("touch,touch,v_000\na,b,2\n", "twice"),
    ("v_000,v_001\n1,2\n3\n", "line 3: 1 columns, expected 2"),
    ("v_000,v_001\n1,2\n3,inf\n", "line 3: reading 1 is 'inf'"),
    ("v_000,v_001\n1,x\n", "line 2: reading 1 is 'x'.*leave the cell empty"),
    ("index,v_000\n,1\n", "line 2: index is ''"),
    ("index,v_000\n0.5,1\n", "line 2: index must hold whole numbers"),
    ("index,v_000\n2,1\n1,1\n", "line 3: index goes back to 1; sort the rows"),
    ("time_s,v_000\n2,1\n1,1\n", "line 3: time_s goes back"),
], ids=lambda text: repr(text)[:30])
def test_what_is_no_recording_is_refused_by_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputFileError, match=words):
        read_recording(written(tmp_path, text))


@pytest.mark.parametrize("text", [
    "1.5 2 3\n-4 nan 6\n", "v_000;v_001;v_002\n1,5;2;3\n-4;;6\n", "1,5\t2\t3\n-4\tNaN\t6\n", "1.5;2;3;\n-4;;6;\n",
    "# my rig, three readings\n1.5  2 3\n-4 nan 6\n", "# v_000,v_001,v_002\n1.5,2,3\n-4,nan,6\n",
    "1.5,\t2,\t3\n-4,\t,\t6\n", "1.5, 2, 3, \n-4, NA, 6, \n"], ids=repr)
def test_cells_are_separated_as_programs_do_it(tmp_path: Path, text: str) -> None:
    np.testing.assert_array_equal(read_recording(written(tmp_path, text)).readings, [[1.5, 2, 3], [-4, np.nan, 6]])


def test_another_number_of_readings_than_the_drive_makes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"line 2: 2 readings a frame, and the model or .* has 208"):
        read_recording(written(tmp_path, "v_000,v_001\n1,2\n"), readings=208)


def test_an_unknown_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="'current' is unknown; known: voltage, magnitude, difference"):
        read_recording(written(tmp_path, "1,2\n"), kind="current")


@pytest.mark.skipif(not REAL.exists(), reason="recordings of real sensors are not here")
@pytest.mark.parametrize(("name", "kind", "frames", "readings", "untouched"), [
    ("hydrogel", "magnitude", 700, 192, 350), ("skin_carbon", "difference", 2000, 192, 0),
    ("skin_plain", "difference", 2000, 192, 0), ("skin_radial", "difference", 2000, 192, 0),
    ("tank", "voltage", 3, 2356, 1)])
def test_recordings_of_real_sensors_are_read(name: str, kind: str, frames: int, readings: int, untouched: int) -> None:
    sensor = read_sensor(REAL / name / "sensor.toml")
    found = read_recording(REAL / name / "frames.csv", kind=sensor.kind, readings=len(pairs_of(sensor)))
    assert (sensor.kind, found.readings.shape) == (kind, (frames, readings))
    assert found.untouched.sum() == untouched
    assert np.isfinite(found.readings).all()
