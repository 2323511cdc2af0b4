"""Readings of driven electrodes that a board leaves at 0 mean one thing in every command: they are not taken."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.electrics.imaging.images import images_of
from eitsim.scene.scene import Scene, scene_from
from eitsim.sensors.calibration.calibrate import calibrate
from eitsim.sensors.conventions import Convention
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import drive_of_pairs, sensor_from
from touchcal.csv_numbers import write_numbers

ALL = Convention(16, 16, 3, "pair", 1, "all", False, 0, 1).pairs()
DRIVEN = (ALL[:, :2, None] == ALL[:, None, 2:]).any(axis=(1, 2))


def scene(pairs: np.ndarray) -> Scene:
    return scene_from({"drive": drive_of_pairs(pairs, 16)})


def frames(pairs: np.ndarray) -> np.ndarray:
    """An untouched frame, and one of a sheet whose electrode 3 lies 0.5 mm off, which an image sees."""
    own = scene(pairs)
    angles = 2 * np.pi / 16 * np.arange(16) + np.where(np.arange(16) == 3, 0.005, 0)
    moved = replace(own, electrodes=replace(own.electrodes, angles_rad=tuple(angles)))
    return np.array([untouched_readings(one, 1e-3).ravel() for one in (own, moved)])


def test_images_of_frames_with_zeros_or_gaps_are_those_without_these_readings(tmp_path: Path) -> None:
    held = frames(ALL)
    names = [f"v_{k:03d}" for k in range(256)]
    write_numbers(tmp_path / "zeros.csv", names, np.where(DRIVEN, 0.0, held))
    write_numbers(tmp_path / "gaps.csv", names, np.where(DRIVEN, np.nan, held))
    write_numbers(tmp_path / "short.csv", names[:len(ALL[~DRIVEN])], held[:, ~DRIVEN])
    short, _ = images_of(tmp_path / "short.csv", scene(ALL[~DRIVEN]), noise_figure=1.0)
    for name in ("zeros.csv", "gaps.csv"):
        found, _ = images_of(tmp_path / name, scene(ALL), noise_figure=1.0)
        np.testing.assert_allclose(found.change, short.change, rtol=1e-6, atol=1e-9 * np.abs(short.change).max())


@pytest.mark.thorough
def test_a_calibration_does_not_call_them_dead() -> None:
    pairs = Convention(8, 8, 3, "pair", 1, "all", False, 0, 1).pairs()
    tables = {"electrodes": {"count": 8}, "drive": drive_of_pairs(pairs, 8)}
    driven = (pairs[:, :2, None] == pairs[:, None, 2:]).any(axis=(1, 2))
    frame = np.where(driven, 0.0, untouched_readings(scene_from(tables), 1e-3).ravel())
    lost = int(np.argmin(driven))
    frame[lost] = 0.0
    found = calibrate(sensor_from(tables, Path()), Recording(frame[None], np.arange(1), None, np.array([""]), "voltage",
                                                             Path("a.csv")))
    assert found.dead == (lost,)
