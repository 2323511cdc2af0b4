"""Files of boards: small ones typed from their documentation are read number by number; what is cut is refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from eitsim.sensors.formats.open_file import formats, open_frames, open_recording
from touchcal.errors import InputFileError

# Header as EIDORS and sciopy name its lines; values made up.
SCIOSPEC = "\n".join(["18", "2", "setup", "2023.01.05. 14:36:10.123", "1000", "1000", "0", "1", "0.001", "10", "0", "1",
                      "1", "4", "0", "1", "MeasurementChannels: 1,2,3",
                      "MeasurementChannelsIndependentFromInjectionPattern: 1,2,3", "1 2", "1.0E-1\t2.0E-1\t3\t4\t5\t6",
                      "2 3", "7\t8\t9\t10\t11\t-1.2E1", ""])
# Two frames as OpenEIT's data sets have them, shortened, between other lines of the board.
OPENEIT = ("starting up\n    magnitudes :   27159.1250 ,   32341.4375 ,   33906.1250 , \n"
           "    magnitudes :   27133.6250 ,   32311.0000 ,   33874.1875 , \n")
EIT_KIT = "Board Initialized\norigin12.50003.250047.0625\nframei12.50013.250147.0626\n"


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_sciospec_frames_are_neighbours_differences_in_the_order_that_they_state(tmp_path: Path) -> None:
    found = open_recording(written(tmp_path, "frame_0001.eit", SCIOSPEC))
    np.testing.assert_allclose(found.readings, [[2.9 + 3.8j, 2 + 2j, -4.9 - 5.8j, 2 + 2j, 2 - 22j, -4 + 20j]])
    assert found.pairs is not None
    assert found.pairs.tolist() == [[0, 1, 1, 0], [0, 1, 2, 1], [0, 1, 0, 2], [1, 2, 1, 0], [1, 2, 2, 1], [1, 2, 0, 2]]
    assert found.untouched.all()


def test_sciospec_channels_without_an_electrode_are_no_electrodes(tmp_path: Path) -> None:
    """Channels 2, 5 and 7 of eight are measured; the lines hold all eight."""
    text = SCIOSPEC.replace("Channels: 1,2,3\n", "Channels: 2,5,7\n", 1)
    text = text.replace("1 2\n", "2 5\n").replace("2 3\n", "5 7\n")
    lines = text.split("\n")
    for line, start in ((19, 0.0), (21, 100.0)):
        lines[line] = "\t".join(f"{start + channel}\t0" for channel in range(1, 9))
    found = open_recording(written(tmp_path, "frame_0001.eit", "\n".join(lines)))
    np.testing.assert_allclose(found.readings, [[3, 2, -5, 3, 2, -5]])
    assert found.pairs is not None
    assert found.pairs[3].tolist() == [1, 2, 1, 0]


def test_a_folder_of_sciospec_files_is_a_recording_in_the_order_of_names(tmp_path: Path) -> None:
    written(tmp_path, "b_00002.eit", SCIOSPEC.replace("3\t4", "30\t40"))
    written(tmp_path, "b_00001.eit", SCIOSPEC)
    found = open_recording(tmp_path)
    np.testing.assert_allclose(found.readings[:, 0], [2.9 + 3.8j, 29.9 + 39.8j])
    assert found.index.tolist() == [0, 1]


def test_serial_lines_are_frames_of_magnitudes(tmp_path: Path) -> None:
    found = open_recording(written(tmp_path, "data.txt", OPENEIT))
    assert found.kind == "magnitude"
    np.testing.assert_array_equal(found.readings, [[27159.125, 32341.4375, 33906.125], [27133.625, 32311, 33874.1875]])


def test_signs_under_the_label_make_voltages(tmp_path: Path) -> None:
    assert open_recording(written(tmp_path, "simdata.txt", "magnitudes : -0.2,0.1,\n")).kind == "voltage"


def test_eit_kit_s_values_without_separators_end_after_four_decimals(tmp_path: Path) -> None:
    found = open_recording(written(tmp_path, "kit.txt", EIT_KIT))
    assert found.kind == "magnitude"
    np.testing.assert_array_equal(found.readings, [[12.5, 3.25, 47.0625], [12.5001, 3.2501, 47.0626]])


def test_columns_are_one_frame(tmp_path: Path) -> None:
    one = open_recording(written(tmp_path, "one.txt", "1.5\n-2\n3e-3\n"))
    np.testing.assert_array_equal(one.readings, [[1.5, -2, 3e-3]])
    pair = open_recording(written(tmp_path, "pair.csv", "re, im\n1,2\n3,-4\n"))
    np.testing.assert_array_equal(pair.readings, [[1 + 2j, 3 - 4j]])


def test_a_row_a_frame_stays_one(tmp_path: Path) -> None:
    assert open_recording(written(tmp_path, "rows.csv", "1,2,3\n4,5,6\n")).readings.shape == (2, 3)
    assert open_recording(written(tmp_path, "named.csv", "v_000,v_001\n1,2\n")).readings.shape == (1, 2)


def test_matlab_arrays_and_eidors_data(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).normal(size=(5, 208))
    savemat(tmp_path / "plain.mat", {"vv": frames.T})
    savemat(tmp_path / "eidors.mat", {"data": {"name": "homogeneous", "type": "data", "meas": frames[0]}})
    savemat(tmp_path / "complex.mat", {"vv": frames * (1 + 1j)})
    np.testing.assert_array_equal(open_recording(tmp_path / "plain.mat").readings, frames)
    np.testing.assert_array_equal(open_recording(tmp_path / "eidors.mat").readings, frames[:1])
    np.testing.assert_array_equal(open_recording(tmp_path / "complex.mat").readings, frames * (1 + 1j))


@pytest.mark.parametrize(("name", "text", "words"), [
    ("a.eit", SCIOSPEC.replace("7\t8\t9\t10\t11\t-1.2E1", "7\t8\t9\t10"), "line 22: an injection without its voltages"),
    ("a.eit", SCIOSPEC.replace("\n2 3\n7", "\n5\t6\t7\t8\t9\t1\n2 3\n7"), "line 21: a second line of voltages"),
    ("a.eit", "\n".join(SCIOSPEC.split("\n")[:18]), "no voltages below the header"),
    ("a.eit", SCIOSPEC.replace("2 3\n", "two three\n"), "line 21: 'two three' holds no numbers"),
    ("a.txt", OPENEIT.replace("33874.1875 ,", ""), "line 3: 2 magnitudes, and most frames have 3|line 2: 3 magnitudes"),
    ("a.txt", OPENEIT.replace("32311.0000", "323x"), "line 3: a frame that holds no numbers only"),
    ("a.txt", EIT_KIT + "framei12.50013.2501\n", "line 4: 2 magnitudes, and most frames have 3"),
    ("a.csv", "1,2\n3,4\n5,6\n", "two columns without names.*Name them re and im"),
    ("a.csv", "re,im\n1,2\n3\n", "line 3: expected 2 numbers"),
    ("a.mat", "no such thing", "not a MATLAB file"),
], ids=lambda text: repr(text)[:25])
def test_what_was_cut_or_is_unclear_is_refused_with_the_fix(tmp_path: Path, name: str, text: str, words: str) -> None:
    with pytest.raises(InputFileError, match=words):
        open_recording(written(tmp_path, name, text))


def test_matlab_files_of_several_arrays_or_unclear_shape_are_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "two.mat", {"a": np.ones((3, 208)), "b": np.ones((3, 208))})
    savemat(tmp_path / "square.mat", {"a": np.ones((208, 208))})
    with pytest.raises(InputFileError, match="2 arrays of readings: a, b"):
        open_recording(tmp_path / "two.mat")
    with pytest.raises(InputFileError, match=r"a is 208 x 208.*whose field meas has one column a frame"):
        open_recording(tmp_path / "square.mat")


def test_untouched_and_touched_eidors_data_are_one_recording(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).normal(size=(4, 208))
    for name, vh, vi in (("plain.mat", frames[:1].T, frames[1:].T), ("data.mat", {"meas": frames[0]},
                                                                     {"meas": frames[1:].T})):
        savemat(tmp_path / name, {"vh": vh, "vi": vi, "fmdl": {"type": "fwd_model"}})
        found = open_recording(tmp_path / name)
        np.testing.assert_array_equal(found.readings, frames)
        assert found.touch.tolist() == ["", "1", "2", "3"]
    savemat(tmp_path / "odd.mat", {"vh": {"meas": frames[0]}, "vi": {"meas": frames[:, :12].T}})
    with pytest.raises(InputFileError, match="vh has 208 readings a frame, and vi 12"):
        open_recording(tmp_path / "odd.mat")


def test_numpy_arrays(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).normal(size=(5, 208))
    for name, array in (("rows.npy", frames), ("columns.npy", frames.T), ("complex.npy", frames * (1 + 1j))):
        np.save(tmp_path / name, array)
    np.testing.assert_array_equal(open_recording(tmp_path / "rows.npy").readings, frames)
    np.testing.assert_array_equal(open_recording(tmp_path / "columns.npy").readings, frames)
    np.testing.assert_array_equal(open_recording(tmp_path / "complex.npy").readings, frames * (1 + 1j))


@pytest.mark.parametrize(("array", "words"), [
    (np.ones((5, 207)), "the array is 5 x 207, and neither is a number of readings.*of 16 electrodes 208, or 256"),
    (np.ones((5, 16, 13)), "an array of float64 with 3 axes. Save numbers, one row a frame"),
    (np.array(["1"]), "an array of <U1 with 1 axes")])
def test_numpy_arrays_that_are_no_frames_are_refused(tmp_path: Path, array: np.ndarray, words: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(InputFileError, match=words):
        open_recording(tmp_path / "a.npy")
    (tmp_path / "b.npy").write_bytes(b"no array")
    with pytest.raises(InputFileError, match="not a NumPy array of numbers"):
        open_recording(tmp_path / "b.npy")


def test_matlab_files_without_readings_say_what_they_hold(tmp_path: Path) -> None:
    savemat(tmp_path / "model.mat", {"fmdl": {"type": "fwd_model"}, "v": np.ones((5, 16, 13))})
    with pytest.raises(InputFileError, match="0 arrays of readings: fmdl is a structure without meas; v is 5 x 16 x"):
        open_recording(tmp_path / "model.mat")


def test_frames_of_any_file_are_those_of_a_csv(tmp_path: Path) -> None:
    volts = np.random.default_rng(0).normal(size=(3, 208))
    np.savetxt(tmp_path / "frames.csv", volts, delimiter=",", fmt="%.17g")
    savemat(tmp_path / "frames.mat", {"v": volts})
    np.save(tmp_path / "turned.npy", volts * np.exp(0.3j))
    for name in ("frames.csv", "frames.mat", "turned.npy"):
        found = open_frames(tmp_path / name, 208)
        np.testing.assert_allclose(found.volts, volts, rtol=0, atol=1e-14)
        assert found.line.tolist() == [1, 2, 3]
    volts[1, 5] = np.nan
    savemat(tmp_path / "frames.mat", {"v": volts})
    assert np.argwhere(np.isnan(open_frames(tmp_path / "frames.mat", 208).volts)).tolist() == [[1, 5]]


def test_eidors_data_have_a_frame_a_column_whatever_their_shape(tmp_path: Path) -> None:
    savemat(tmp_path / "eidors.mat", {"data": {"meas": np.arange(208.0 * 100).reshape(208, 100)}})
    np.testing.assert_array_equal(open_recording(tmp_path / "eidors.mat").readings[1, :2], [1.0, 101.0])


def test_another_count_than_the_drive_makes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="3 readings a frame, and the model or the sensor's drive has 208"):
        open_recording(written(tmp_path, "data.txt", OPENEIT), readings=208)


def test_every_layout_has_a_title_of_its_own() -> None:
    assert len({one.title for one in formats()}) == len(formats())
