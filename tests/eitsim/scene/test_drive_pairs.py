"""A file of pairs in [drive] makes the same readings in scenes, designs and sensor files as the drive it lists."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.scene.drive import protocol
from eitsim.scene.drive_pairs import PAIRS
from eitsim.scene.scene import read_scene, scene_from
from eitsim.sensors.sensor_file import Sensor, pairs_of
from eitsim.sweeps.design.design import read_design
from touchcal.errors import InputFileError


def _written(path: Path, rows: np.ndarray) -> None:
    path.write_text("\n".join([",".join(PAIRS), *(",".join(map(str, row)) for row in rows.tolist())]), encoding="utf-8")


def test_pairs_in_a_scene_and_a_design_are_the_named_drive(tmp_path: Path) -> None:
    named = scene_from({"drive": {"pattern": "skip-2", "reading": "differential"}})
    _written(tmp_path / "pairs.csv", pairs_of(Sensor(named.body, named.skin, named.electrodes, named.drive)))
    (tmp_path / "scene.toml").write_text('[drive]\npairs = "pairs.csv"\n', encoding="utf-8")
    (tmp_path / "design.toml").write_text("scenes = 2\n[drive]\npairs = \"pairs.csv\"\n[punch]\nforce_N = [0.1, 1]\n",
                                          encoding="utf-8")
    expected = protocol(named.drive, 16)
    designed = scene_from({"drive": read_design(tmp_path / "design.toml").tables["drive"]})
    for found in (read_scene(tmp_path / "scene.toml"), designed):
        made = protocol(found.drive, 16)
        np.testing.assert_allclose(made.currents_A, expected.currents_A, atol=1e-15)
        np.testing.assert_allclose(made.weights, expected.weights)


def test_quadrupoles_of_any_list_are_one_pattern_each(tmp_path: Path) -> None:
    _written(tmp_path / "pairs.csv", np.array([[0, 4, 1, 2], [3, 9, 5, 11], [3, 9, 6, 7]]))
    (tmp_path / "scene.toml").write_text('[drive]\npairs = "pairs.csv"\n', encoding="utf-8")
    assert protocol(read_scene(tmp_path / "scene.toml").drive, 16).shape == (3, 1)


def test_an_electrode_that_is_none_is_refused_by_its_line(tmp_path: Path) -> None:
    _written(tmp_path / "pairs.csv", np.array([[0, 4, 1, 2], [3, 16, 5, 11]]))
    (tmp_path / "scene.toml").write_text('[drive]\npairs = "pairs.csv"\n', encoding="utf-8")
    with pytest.raises(InputFileError, match="line 3: 16 is no electrode"):
        read_scene(tmp_path / "scene.toml")
