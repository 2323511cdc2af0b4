"""Current patterns and readings: named ones, and any matrices."""

import json
from pathlib import Path

import numpy as np
import pytest

from eitsim.scene.drive import Drive, protocol, read_out
from eitsim.scene.scene import read_scene, scene_from, scene_tables
from eitsim.sweeps.design.design import read_design
from touchcal.errors import InputFileError

NAMED = ("adjacent", "opposite", "skip-2", "skip-3")


def electrodes_read(drive: Drive, count: int) -> list[list[tuple[int, int]]]:
    """(positive, negative) electrode of every reading of every pattern."""
    return [[(int(row.argmax()), int(row.argmin())) for row in rows] for rows in protocol(drive, count).weights]


def random_impedance(count: int, seed: int = 3) -> np.ndarray:
    root = np.random.default_rng(seed).normal(size=(count, count))
    root -= root.mean(axis=0)
    return root.T @ root


def test_adjacent_reads_the_papers_electrodes_in_its_order():
    pairs = electrodes_read(Drive(), 16)
    assert protocol(Drive(), 16).shape == (16, 13)
    assert pairs[0] == [(j, 15) for j in range(2, 15)]
    assert pairs[15] == [((15 + j) % 16, 14) for j in range(2, 15)]


@pytest.mark.parametrize(("pattern", "step"), [("adjacent", 1), ("opposite", 8), ("skip-0", 1), ("skip-3", 4)])
def test_single_ended_reads_every_electrode_but_source_sink_and_reference(pattern, step):
    for k, pairs in enumerate(electrodes_read(Drive(pattern=pattern), 16)):
        assert {negative for _, negative in pairs} == {(k - 1) % 16}
        assert sorted([positive for positive, _ in pairs] + [k, (k + step) % 16, (k - 1) % 16]) == list(range(16))


@pytest.mark.parametrize("pattern", NAMED)
def test_differential_reads_all_neighbours_that_carry_no_current(pattern):
    drive = Drive(pattern=pattern, reading="differential")
    for currents, pairs in zip(protocol(drive, 16).currents_A, electrodes_read(drive, 16), strict=True):
        free = [j for j in range(16) if not currents[[j, (j + 1) % 16]].any()]
        assert sorted(pairs) == sorted(((j + 1) % 16, j) for j in free)


@pytest.mark.parametrize("pattern", NAMED)
@pytest.mark.parametrize("reading", ["single-ended", "differential"])
def test_readings_are_voltages_of_the_pattern(pattern, reading):
    drive = Drive(current_A=2e-3, pattern=pattern, reading=reading)
    z, got, pairs = random_impedance(8), read_out(drive, random_impedance(8)), electrodes_read(drive, 8)
    step = {"adjacent": 1, "opposite": 4, "skip-2": 3, "skip-3": 4}[pattern]
    for k in range(8):
        voltage = 2e-3 * (z[:, k] - z[:, (k + step) % 8])
        np.testing.assert_allclose(got[k], [voltage[a] - voltage[b] for a, b in pairs[k]], rtol=0, atol=1e-15)


@pytest.mark.parametrize("pattern", NAMED)
@pytest.mark.parametrize("reading", ["single-ended", "differential"])
def test_a_named_drive_is_its_own_matrices(pattern, reading):
    named = Drive(pattern=pattern, reading=reading)
    asked = protocol(named, 16)
    tables = {"current_mA": 5, "currents": (asked.currents_A / 5e-3).tolist(), "measurements": asked.weights.tolist()}
    general = scene_from({"drive": tables}).drive
    np.testing.assert_array_equal(read_out(general, random_impedance(16)), read_out(named, random_impedance(16)))


def test_one_matrix_of_measurements_serves_all_patterns():
    angle = 2 * np.pi * np.arange(8) / 8
    currents = [np.cos(m * angle).tolist() for m in (1, 2, 3)]
    drive = {"currents": currents, "measurements": np.eye(8).tolist()}
    scene = scene_from({"electrodes": {"count": 8}, "drive": drive})
    z = random_impedance(8)
    got = read_out(scene.drive, z)
    np.testing.assert_allclose(got, 5e-3 * (z @ np.array(currents).T).T, atol=1e-15)
    assert scene_tables(scene)["drive"].keys() == {"current_mA", "currents", "measurements"}
    assert scene_from(json.loads(json.dumps(scene_tables(scene)))) == scene
    assert hash(scene.drive) == hash(scene_from(scene_tables(scene)).drive)


def test_a_named_pattern_may_be_read_by_any_matrix():
    weights = np.random.default_rng(0).normal(size=(5, 8))
    drive = scene_from({"electrodes": {"count": 8}, "drive": {"measurements": weights.tolist()}}).drive
    z = random_impedance(8)
    np.testing.assert_allclose(read_out(drive, z)[2], 5e-3 * weights @ (z[:, 2] - z[:, 3]), atol=1e-15)


def test_differential_readings_are_differences_of_single_ended_ones():
    z = random_impedance(16)
    single, differential = (read_out(Drive(reading=r), z) for r in ("single-ended", "differential"))
    np.testing.assert_allclose(differential[:, :-1], np.diff(single, axis=1), atol=1e-15)


@pytest.mark.parametrize("reading", ["single-ended", "differential"])
def test_only_readings_that_need_a_missing_electrode_are_missing(reading):
    drive, z = Drive(reading=reading), random_impedance(16)
    whole = read_out(drive, z)
    z[4] = z[:, 4] = np.nan
    got, asked = read_out(drive, z), protocol(drive, 16)
    needs = asked.weights[..., 4].astype(bool) | asked.currents_A[:, 4].astype(bool)[:, None]
    np.testing.assert_array_equal(np.isnan(got), needs)
    np.testing.assert_array_equal(got[~needs], whole[~needs])


def test_reciprocity_leaves_104_independent_readings_of_208():
    for reading in ("single-ended", "differential"):
        rows = [read_out(Drive(reading=reading), random_impedance(16, seed)).ravel() for seed in range(150)]
        assert np.linalg.matrix_rank(np.array(rows)) == 104


def test_files_of_matrices_stand_beside_the_scene_or_the_design(tmp_path: Path):
    (tmp_path / "currents.csv").write_text("1,-1,0,0\n0,0,1,-1\n")
    (tmp_path / "pairs.csv").write_text("pattern,a,b,c,d\n0,0,0,1,-1\n1,1,-1,0,0\n0,0,1,-1,0\n1,-1,0,0,1\n")
    text = '[electrodes]\ncount = 4\n[drive]\ncurrents = "currents.csv"\nmeasurements = "pairs.csv"\n'
    (tmp_path / "scene.toml").write_text(text)
    (tmp_path / "design.toml").write_text("scenes = 2\n" + text)
    drive = read_scene(tmp_path / "scene.toml").drive
    assert drive.currents == ((1, -1, 0, 0), (0, 0, 1, -1))
    assert drive.measurements == (((0, 0, 1, -1), (0, 1, -1, 0)), ((1, -1, 0, 0), (-1, 0, 0, 1)))
    z = random_impedance(4)
    np.testing.assert_allclose(read_out(drive, z)[0, 0], 5e-3 * (z[2] - z[3]) @ [1, -1, 0, 0])
    assert read_design(tmp_path / "design.toml").tables["drive"]["currents"] == [[1, -1, 0, 0], [0, 0, 1, -1]]
    (tmp_path / "pairs.csv").write_text("pattern,a,b,c,d\n0,0,0,1,-1\n2,1,-1,0,0\n")
    with pytest.raises(InputFileError, match=r"pairs\.csv: pattern 1 has no rows"):
        read_scene(tmp_path / "scene.toml")
    (tmp_path / "currents.csv").write_text("1,-1,0,0\n0,0,one,-1\n")
    with pytest.raises(InputFileError, match=r"currents\.csv, line 2: column 3 holds 'one'"):
        read_scene(tmp_path / "scene.toml")


PAIR, READ = [[1, -1, 0, 0]], [[0, 0, 1, -1]]


@pytest.mark.parametrize(("drive", "message"), [
    ({"pattern": "opposit"}, "known: adjacent, opposite, skip-N"), ({"pattern": "skip-x"}, "unknown"),
    ({"pattern": "skip-2"}, "at most 1"), ({"reading": "both"}, "known: single-ended, differential"),
    ({"currents": [[1, 0, 0, 0]], "measurements": READ}, r"pattern 0 sum to 0\.005 A"),
    ({"currents": [[0, 0, 0, 0]], "measurements": READ}, "pattern 0 drives no current"),
    ({"currents": [[1, -1, 0]], "measurements": READ}, "rows of 4 finite numbers, one an electrode, got 1x3"),
    ({"currents": PAIR}, "needs measurements"), ({"currents": "c.csv", "measurements": READ}, "must hold rows"),
    ({"currents": [[1, -1], [1, 0, -1]], "measurements": READ}, "unequal length"),
    ({"currents": PAIR, "measurements": [[0, 0, 0, 0]]}, "reading 0 of pattern 0 has no weight"),
    ({"currents": PAIR, "measurements": [READ, READ]}, "matrices for 2 patterns, but 1 are driven"),
    ({"currents": PAIR * 2, "measurements": [READ, READ * 2]}, "1, 2 readings"),
    ({"currents": PAIR, "measurements": READ, "pattern": "opposite"}, "no effect with currents"),
    ({"measurements": READ, "reading": "differential"}, "no effect with measurements"),
    ({"currents": [[1, "a", 0, 0]], "measurements": READ}, "must be a finite number, got 'a'"),
    ({"currents": [1, -1, 0, 0], "measurements": READ}, "must hold rows"),
    ({"pattern": "skip-1", "reading": "differential"}, "nothing is read")])
def test_drives_that_cannot_be_are_refused(drive, message):
    with pytest.raises(ValueError, match=message):
        scene_from({"electrodes": {"count": 4}, "drive": drive})


def test_opposite_needs_an_even_number():
    with pytest.raises(ValueError, match="even number"):
        scene_from({"electrodes": {"count": 15}, "drive": {"pattern": "opposite"}})


def test_what_is_read_cannot_be_drawn(tmp_path: Path):
    (tmp_path / "design.toml").write_text('scenes = 2\n[drive]\npattern = {choice = ["adjacent", "opposite"]}\n')
    with pytest.raises(InputFileError, match=r"pattern in \[drive\] is drawn"):
        read_design(tmp_path / "design.toml")
