"""Sensor files: the tables of a scene and pairs of electrodes; pairs mean what patterns and matrices mean."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.scene.drive import read_out
from eitsim.scene.scene import read_scene
from eitsim.sensors.sensor_file import (
    Sensor,
    drive_of_pairs,
    pairs_of,
    read_pairs,
    read_sensor,
    scene_of_frames,
    sensor_from,
    write_pairs,
)
from touchcal.errors import InputFileError

HEADER = "source,sink,plus,minus\n"


def written(tmp_path: Path, pairs: str, sensor: str = '[drive]\npairs = "pairs.csv"\n') -> Path:
    (tmp_path / "pairs.csv").write_text(pairs, encoding="utf-8")
    (tmp_path / "sensor.toml").write_text(sensor, encoding="utf-8")
    return tmp_path / "sensor.toml"


def impedance(count: int) -> np.ndarray:
    random = np.random.default_rng(0).normal(size=(count, count))
    return random + random.T


def of_pattern(pattern: str, reading: str = "single-ended") -> Sensor:
    return sensor_from({"drive": {"pattern": pattern, "reading": reading}}, Path())


def test_pairs_read_one_voltage_each(tmp_path: Path) -> None:
    pairs = [(0, 8, 2, 1), (0, 8, 5, 3), (1, 4, 6, 9)]  # runs of unequal length
    path = written(tmp_path, HEADER + "".join(f"{a},{b},{c},{d}\n" for a, b, c, d in pairs))
    sensor, z = read_sensor(path), impedance(16)
    expected = [z[c, a] - z[c, b] - z[d, a] + z[d, b] for a, b, c, d in pairs]
    np.testing.assert_allclose(read_out(sensor.drive, z).ravel(), sensor.drive.current_A * np.array(expected))
    np.testing.assert_array_equal(pairs_of(sensor), pairs)


@pytest.mark.parametrize(("pattern", "reading"), [("adjacent", "single-ended"), ("opposite", "differential"),
                                                  ("skip-3", "differential")])
def test_pairs_of_a_pattern_read_the_same_as_the_pattern(pattern: str, reading: str) -> None:
    by_name, z = of_pattern(pattern, reading), impedance(16)
    by_pairs = sensor_from({"drive": drive_of_pairs(pairs_of(by_name), 16)}, Path())
    assert by_pairs.protocol.shape == by_name.protocol.shape
    np.testing.assert_allclose(read_out(by_pairs.drive, z), read_out(by_name.drive, z))


def test_columns_of_pairs_stand_in_any_order(tmp_path: Path) -> None:
    path = written(tmp_path, "minus,plus,sink,source\n1,2,8,0\n")
    assert pairs_of(read_sensor(path)).tolist() == [[0, 8, 2, 1]]


def test_a_scene_s_words_and_kind(tmp_path: Path) -> None:
    text = ('[body]\nradius_mm = 45\n[skin]\nthickness_um = 30\n[electrodes]\ncount = 8\nwidth_mm = 5\n[drive]\n'
            'pattern = "opposite"\ncurrent_mA = 2\n[readings]\nkind = "magnitude"\n')
    sensor = read_sensor(written(tmp_path, HEADER, text))
    assert (sensor.body.radius_m, sensor.electrodes.count, sensor.kind) == (0.045, 8, "magnitude")
    assert sensor.skin.thickness_m == pytest.approx(30e-6)
    assert sensor.protocol.shape == (8, 5)
    assert sensor.scene.drive == sensor.drive


@pytest.mark.parametrize(("pairs", "sensor", "words"), [
    (HEADER + "0,1,2,16\n", '[drive]\npairs = "pairs.csv"\n', r"pairs.csv, line 2: 16 is no electrode; there are 16"),
    (HEADER + "0,1,2,2\n", '[drive]\npairs = "pairs.csv"\n', "line 2: source and sink, or plus and minus"),
    ("a,b,c,d\n0,1,2,3\n", '[drive]\npairs = "pairs.csv"\n', "its header must name source, sink, plus, minus"),
    (HEADER, '[drive]\npairs = "other.csv"\n', "other.csv: no such file"),
    (HEADER, '[drive]\npairs = 3\n', "pairs in .drive. must be the name of a CSV file"),
    (HEADER, '[drive]\npairs = "pairs.csv"\npattern = "opposite"\n', "pattern in .drive. has no effect with pairs"),
    (HEADER, '[electrodes]\ncount = 100\n[drive]\npairs = "pairs.csv"\n', "a whole number from 4 to 64, got 100"),
    (HEADER, '[readings]\nkind = "phase"\n', "kind in .readings. 'phase' is unknown; known: voltage"),
    (HEADER, '[readings]\nunit = "V"\n', "unknown key 'unit' in .readings."),
    (HEADER, '[punch]\nx_mm = 1\n', "unknown key 'punch'"),
    (HEADER, '[drive]\npair = "pairs.csv"\n', "known: current_mA, .*pairs.* Did you mean 'pairs'"),
    (HEADER, '[body]\nradius = 1\n', "unknown key 'radius' in .body."),
], ids=lambda text: text[-25:])
def test_what_is_no_sensor_is_refused_by_file_and_key(tmp_path: Path, pairs: str, sensor: str, words: str) -> None:
    with pytest.raises(InputFileError, match=words):
        read_sensor(written(tmp_path, pairs, sensor))


def test_readings_that_are_no_pairs_are_refused() -> None:
    currents, measurements = [[2, -1, -1, 0]], [[0, 1, 0, -1]]
    sensor = sensor_from({"electrodes": {"count": 4},
                          "drive": {"currents": currents, "measurements": measurements}}, Path())
    with pytest.raises(ValueError, match=r"pattern 0 in .drive. is not 1 at one electrode and -1 at another"):
        pairs_of(sensor)


def test_frames_have_the_scene_of_a_scene_file_or_of_a_sensor_file(tmp_path: Path) -> None:
    path = tmp_path / "any.toml"
    path.write_text("[body]\nradius_mm = 45\n[punch]\nx_mm = 3\n")
    assert scene_of_frames(path) == (read_scene(path), "voltage")
    (tmp_path / "pairs.csv").write_text("source,sink,plus,minus\n0,1,2,3\n1,2,3,4\n")
    path.write_text('[body]\nradius_mm = 45\n[drive]\npairs = "pairs.csv"\n')
    assert scene_of_frames(path) == (read_sensor(path).scene, "voltage")
    path.write_text('[readings]\nkind = "difference"\n')
    assert scene_of_frames(path)[1] == "difference"


def test_pairs_that_are_written_are_read_again(tmp_path: Path) -> None:
    pairs = np.array([[0, 1, 2, 3], [1, 2, 4, 3]])
    write_pairs(pairs, tmp_path / "pairs.csv")
    np.testing.assert_array_equal(read_pairs(tmp_path / "pairs.csv", 16), pairs)
