"""Scene files: units convert once, defaults are the paper's sensor, every mistake is named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitsim.scene.scene import Body, Electrodes, Hold, Punch, Scene, as_scene, read_scene, scene_from, scene_tables
from touchcal.errors import InputFileError


def test_every_key_is_optional() -> None:
    assert scene_from({}) == Scene()


def test_units_convert_and_come_back() -> None:
    raw = {"punch": {"x_mm": 20, "y_mm": -10, "diameter_mm": 14, "force_N": 2}, "electrodes": {"first_angle_deg": 90}}
    raw["punch"] |= {"profile": "cone", "half_angle_deg": 45}
    scene = scene_from(raw)
    assert scene.punches[0].half_angle_rad == pytest.approx(0.78539816)
    assert scene.punches[0].x_m == pytest.approx(0.02)
    assert scene.electrodes.first_angle_rad == pytest.approx(1.5707963)
    assert scene_from(scene_tables(scene)) == scene


def test_depth_replaces_force() -> None:
    (punch,) = scene_from({"punch": {"depth_mm": 2}}).punches
    assert (punch.force_N, punch.depth_m) == (None, pytest.approx(0.002))
    assert scene_from(scene_tables(scene_from({"punch": {"depth_mm": 2}}))).punches == (punch,)


@pytest.mark.parametrize(("raw", "named"), [
    ({"punch": {"radius": 3}}, "radius"), ({"punch": {"force_N": -1}}, "force_N"),
    ({"punch": {"force_N": 1, "depth_mm": 1}}, "force_N and depth_mm"), ({"colour": {}}, "colour"),
    ({"punch": {"profile": "star"}}, "flat, sphere, cone"), ({"skin": {"strain": "shear"}}, "normal, principal, areal"),
    ({"punch": {"x_mm": "left"}}, "x_mm"), ({"punch": {"x_mm": float("nan")}}, "x_mm"),
    ({"punch": {"fillet_mm": 0}}, "sharp edge"), ({"punch": {"half_angle_deg": 90}}, "half_angle_deg.*cone"),
    ({"punch": {"friction": "glue"}}, "none, stick, coulomb"),
    ({"punch": {"friction": "coulomb"}}, "friction_coefficient.*positive"),
    ({"punch": {"friction": "stick", "friction_coefficient": 0.3}}, "friction_coefficient.*no effect"),
    ({"electrodes": {"width_mm": 60}}, "radius_mm = 100 may be 39.269 wide at most"),
    ({"electrodes": {"count": 16.5}}, "count"), ({"punch": {"depth_mm": 12}}, "thickness"), ({"hold": 3}, r"\[hold\]"),
    ({"electrodes": {"turn_deg": []}}, "turn_deg in .electrodes.: must hold 16 numbers, one an electrode, got 0"),
    ({"hold": {"time_s": [[1.0], 2.0]}}, "time_s in .hold. must be positive numbers"),
    ({"punch": {"diameter_mm": 0}}, "diameter_mm.*must be positive"),
    ({"accuracy": {"signal": 5}}, "from 1e-09 to 1, got 5"),
    ({"electrodes": {"count": "16"}}, "count in .electrodes. must be a whole number, got '16'"),
])
def test_mistakes_are_named(raw: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        scene_from(raw)


def test_a_bad_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text("[punch\nx_mm = 1")
    with pytest.raises(InputFileError, match=r"scene\.toml.*TOML"):
        read_scene(tmp_path / "scene.toml")


def test_numbers_of_numpy_are_numbers() -> None:
    parts: list[Any] = [np.float32(0.25), np.float32(0.0078125), np.int64(8), np.array([1.0, 2.0], np.float32)]
    by_numpy = Scene(punches=(Punch(force_N=parts[0], x_m=np.float64(0.01)),), body=Body(thickness_m=parts[1]),
                     electrodes=Electrodes(count=parts[2]), hold=Hold(time_s=parts[3]))
    plain = Scene(punches=(Punch(force_N=0.25, x_m=0.01),), body=Body(thickness_m=0.0078125),
                  electrodes=Electrodes(count=8), hold=Hold(time_s=(1.0, 2.0)))
    assert as_scene(by_numpy) == plain
    assert type(by_numpy.punches[0].force_N) is type(by_numpy.hold.time_s[0]) is float
