"""Files that state the order of their readings are believed; what a file says is not asked for."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from eitsim.sensors.companions import independent, late_readings
from eitsim.sensors.conventions import Convention
from eitsim.sensors.disc_field import pair_fields
from eitsim.sensors.formats.open_file import open_frames, open_recording
from eitsim.sensors.inspection import inspect
from touchcal.errors import InputFileError

SKIP_6 = Convention(16, 16, 7, "pair", 7, "all", False, 0, 1).pairs()
BERT = ("4# Number of sensors\n#x z\n0 0\n1 0\n2 0\n3 0\n3# Number of data\n#a b m n r\n1 4 2 3 1.5\n2 1 3 4 -0.25\n"
        "4 3 2 1 2e-3\n")
R2 = "2\n 1 1 4 2 3 1.5 70.1\n 2 2 1 3 4 -0.25 71\n"
ERT = "C1 C2 P1 P2 V (mV) I (mA)\n1 4 2 3 7.5 5\n2 1 3 4 -1.25 5\n"
FROM_0 = "A;B;M;N;R [kOhm]\n0;3;1;2;1.5e-3\n1;0;2;3;-0.25e-3\n2;1;0;3;1\n3;2;1;0;1\n"
NAMED = "n,a,b,m,r/Ohm\n3,1,4,2,1.5\n4,2,1,3,-0.25\n"


GERMAN = "a;b;m;n;r\n1;4;2;3;1,5\n2;1;3;4;-0,25\n"
APPARENT = "a b m n rhoa k\n1 4 2 3 3 2\n2 1 3 4 -1 4\n"


@pytest.mark.parametrize(("name", "text"), [("a.ohm", BERT), ("protocol.dat", R2), ("a.csv", NAMED), ("ert.txt", ERT),
                                            ("zero.csv", FROM_0), ("german.csv", GERMAN), ("apparent.dat", APPARENT)])
def test_quadrupoles_are_pairs_and_a_frame(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    found = open_recording(tmp_path / name)
    assert found.pairs is not None
    assert found.pairs[:2].tolist() == [[0, 3, 1, 2], [1, 0, 2, 3]]
    assert found.readings[0, :2] == pytest.approx([1.5, -0.25], rel=1e-12)
    assert found.readings.shape == (1, {"a.ohm": 3, "zero.csv": 4}.get(name, 2))


@pytest.mark.parametrize(("text", "words"), [
    (BERT.replace("2 1 3 4", "2 0 3 4"), "line 10: electrode 0 stands for one that is far away"),
    (BERT.replace("2 1 3 4", "2 2 3 4"), "line 10: a and b, or m and n, are the same electrode"),
    (APPARENT.replace(" k", ""), "it holds an apparent resistivity"),
    ("a,b,m,n,r\n1,4,2,3,1,5\n", "line 2: 6 cells below 5 names. Write numbers with a point"),
    (BERT.replace("4 3 2 1 2e-3\n", ""), "2 rows of quadrupoles, and it states 3")])
def test_quadrupoles_that_are_none_are_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.ohm").write_text(text, encoding="utf-8")
    with pytest.raises(InputFileError, match=words):
        open_recording(tmp_path / "a.ohm")


def test_a_list_of_quadrupoles_that_is_repeated_is_frames(tmp_path: Path) -> None:
    rows = NAMED.split("\n", 1)[1]
    (tmp_path / "a.csv").write_text(NAMED + rows.replace("1.5", "1.6") + rows, encoding="utf-8")
    found = open_recording(tmp_path / "a.csv")
    assert found.readings.tolist() == [[1.5, -0.25], [1.6, -0.25], [1.5, -0.25]]


def test_eidors_stimulations_anywhere_in_the_file_state_the_order(tmp_path: Path) -> None:
    unit = np.eye(16)
    stimulation = [{"stim_pattern": 0.005 * (unit[one[0, 0]] - unit[one[0, 1]])[:, None],
                    "meas_pattern": unit[one[:, 2]] - unit[one[:, 3]]} for one in SKIP_6.reshape(16, 16, 4)]
    random = np.random.default_rng(0)
    savemat(tmp_path / "a.mat", {"System": {"Pattern": {"stim": np.array(stimulation, dtype=object)}},
                                 "vh": random.normal(size=256), "vi": random.normal(size=(256, 20))})
    found = open_recording(tmp_path / "a.mat")
    np.testing.assert_array_equal(found.pairs, SKIP_6)
    assert (found.readings.shape, int(found.untouched.sum())) == ((21, 256), 1)
    seen = inspect(found)
    assert (seen.identified.words()["pattern"], seen.identified.decided_by) == ("skip-6", "file")


@pytest.mark.parametrize("frames", [20, 208, 99])
def test_vh_of_one_column_says_which_axis_of_vi_holds_the_readings(tmp_path: Path, frames: int) -> None:
    random = np.random.default_rng(1)
    touched = random.normal(size=(256, frames))
    savemat(tmp_path / "a.mat", {"vh": random.normal(size=(256, 1)), "vi": touched})
    found = open_recording(tmp_path / "a.mat")
    np.testing.assert_array_equal(found.readings[1:], touched.T)
    assert found.touch.tolist() == ["", *map(str, range(1, frames + 1))]


def test_goe_mf_frames_have_no_header(tmp_path: Path) -> None:
    frames = np.random.default_rng(2).normal(size=(5, 256)).astype("<f4")
    (tmp_path / "a.get").write_bytes(frames.tobytes())
    np.testing.assert_array_equal(open_recording(tmp_path / "a.get").readings, frames)
    (tmp_path / "cut.get").write_bytes(frames.tobytes()[:-4])
    with pytest.raises(InputFileError, match="5116 bytes, and frames of 256 numbers"):
        open_recording(tmp_path / "cut.get")


@pytest.mark.parametrize("header", ["", "v_000,v_001,v_002\n", "v_000,v_001,v_002,\n"])
def test_a_comma_at_the_end_of_every_line_is_no_reading(tmp_path: Path, header: str) -> None:
    (tmp_path / "a.csv").write_text(header + "1, 2, 3, \n4, 5, 6, \n", encoding="utf-8")
    np.testing.assert_array_equal(open_recording(tmp_path / "a.csv").readings, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(open_frames(tmp_path / "a.csv", 3).volts, [[1, 2, 3], [4, 5, 6]])


def test_a_last_reading_that_a_header_names_is_dead(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("v_000,v_001,v_002\n1,2,\n4,5,\n", encoding="utf-8")
    assert np.isnan(open_recording(tmp_path / "a.csv").readings[:, 2]).all()


@pytest.mark.parametrize("seed", range(4))
def test_no_reading_of_a_slow_target_is_late(seed: int) -> None:
    """One turn of a target in 99 frames, unequal gains, noise that some readings have more of."""
    random, pairs = np.random.default_rng(seed), Convention(16, 16, 1, "pair", 1, "undriven", False, 0, 1).pairs()
    place = 0.6 * np.exp(2j * np.pi * np.arange(99) / 99)
    signal = np.real(np.conj(pair_fields(pairs[:, :2], 16, place)) * pair_fields(pairs[:, 2:], 16, place)).T
    signal = signal * np.exp(0.5 * random.normal(size=len(pairs)))
    noise = 0.1 * np.exp(random.normal(size=len(pairs))) * np.sqrt(np.mean(signal**2, axis=0))
    held = signal + noise * random.normal(size=signal.shape)
    assert independent(held) < 99
    assert not late_readings(held).any()


def test_late_readings_stand_at_an_end_of_the_row() -> None:
    random = np.random.default_rng(7)
    true = random.normal(size=(200, 3)) @ random.normal(size=(3, 40)) + 0.1 * random.normal(size=(200, 40))
    for places, expected in ((range(33, 40), range(33, 40)), ([11, 25], [])):
        late = true.copy()
        late[1:, list(places)] = true[:-1, list(places)]
        assert np.flatnonzero(late_readings(late)).tolist() == list(expected)
