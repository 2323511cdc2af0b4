"""The report of a calibrated sensor: verdict, what to repair, and that it is drawn whatever the calibration gave."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Skin
from eitsim.sensors.calibration.calibrate import Calibration
from eitsim.sensors.calibration.calibration_file import calibration_document
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, sources
from eitsim.sensors.calibration.ohm_tests import OhmTests
from eitsim.sensors.calibration.stages import Fit, Stage
from eitsim.sensors.sensor_file import Sensor
from reports.sensor import sensor_report
from reports.sensor.repairs import NONE, repairs
from touchcal.json_file import write_json

SENSOR = Sensor(Body(), Skin(), Electrodes(count=8), Drive(1e-3, "skip-1", "differential"))
HELD = Instrument(SENSOR.body, SENSOR.electrodes, sources(SENSOR.protocol), 1e-3)


def document(changes: dict[str, tuple[int, float]] | None = None, **more: Any) -> dict[str, Any]:
    """Of a calibration whose state is the prior mean but for one parameter of some groups."""
    state = HELD.prior_mean
    for group, (k, value) in (changes or {}).items():
        state[HELD.places[group].start + k] = value
    fit = Fit(state, 1e-6, 0.0, np.diag((0.01 * HELD.prior_sd) ** 2))
    stages = {group: Stage(0.2 / (n + 1), 0.21 / (n + 1), kept=group != "width") for n, group in enumerate(GROUPS)}
    kept = tuple(group for group in GROUPS if group != "width")
    return calibration_document(Calibration(SENSOR, 3, OhmTests(1e-4, 0.05, None, 0.02), "", stages, kept, HELD, fit,
                                            by_electrode=tuple(np.linspace(0.01, 0.03, 8)), **more))


def test_nothing_to_repair_on_an_ideal_sensor() -> None:
    assert repairs(document()) == [NONE]


@pytest.mark.parametrize(("group", "value", "words"), [
    ("contacts", 3.0, "contact impedance of electrode 5 is 20 times the ring's median"),
    ("gains", 1.2, "gain of channel 5 is 120 % of the mean"),
    ("leaks", 2e-4, "Electrode 5 leaks 200 uS to ground"),
    ("positions", 4e-3, "Electrode 5 lies 4.00 mm from where"),
    ("currents", 0.8, "current from electrode 5 is 80 % of the mean")])
def test_what_is_to_be_repaired_is_named(group: str, value: float, words: str) -> None:
    (found,) = repairs(document({group: (5, value)}))
    assert words in found


def test_faults_come_first() -> None:
    found = repairs(document(left_out={3: "100% of the readings at it are dead"}, dead=(4, 5)))
    assert found[0].startswith("Electrode 3 is left out, since 100% of the readings at it are dead")
    assert "2 readings are dead, first 4" in found[1]


def test_a_usable_and_a_refused_sensor_are_drawn(tmp_path: Path) -> None:
    write_json(document({"contacts": (5, 3.0)}), tmp_path / "sensor.json")
    report = sensor_report.report(tmp_path / "sensor.json")
    assert [plate.name for plate in report.plates] == ["electrodes", "channels", "stages", "residuals"]
    assert report.verdict[0].grade == "good"
    assert any("width" in finding for finding in report.findings)
    sensor_report.write(tmp_path / "sensor.json", tmp_path / "sensor.pdf")
    assert (tmp_path / "sensor.pdf").read_bytes().startswith(b"%PDF")
    refused = calibration_document(Calibration(SENSOR, 0, None, "the readings are differences."))
    write_json(refused, tmp_path / "refused.json")
    sensor_report.write(tmp_path / "refused.json", tmp_path / "refused.pdf")
    report = sensor_report.report(tmp_path / "refused.json")
    assert (report.verdict[0].grade, report.verdict[0].why) == ("not usable", "the readings are differences.")
    assert not report.plates


def test_electrodes_at_uneven_angles_are_drawn_where_they_lie(tmp_path: Path) -> None:
    angles_deg = (0.0, 20.0, 45.0, 70.0, 180.0, 225.0, 270.0, 320.0)
    described = Sensor(Body(), Skin(), Electrodes(count=8, angles_rad=tuple(np.radians(angles_deg))), SENSOR.drive)
    ideal = Instrument(described.body, described.electrodes, sources(described.protocol), 1e-3)
    calibration = Calibration(described, 3, None, "", {"conductance": Stage(0.1, 0.1, kept=True)}, ("conductance",),
                              ideal, Fit(ideal.prior_mean, 1e-6, 0.0, np.diag(ideal.prior_sd**2)),
                              by_electrode=(0.01,) * 8)
    write_json(calibration_document(calibration), tmp_path / "sensor.json")
    for plate in sensor_report.report(tmp_path / "sensor.json").plates[:2]:
        xy = np.array([np.mean(line.get_xydata(), axis=0) for line in plate.figure.axes[0].lines])
        np.testing.assert_allclose(np.degrees(np.arctan2(xy[:, 1], xy[:, 0])) % 360, angles_deg, atol=1e-6)


def test_a_calibration_that_predicts_worse_than_a_uniform_sheet_is_cautioned(tmp_path: Path) -> None:
    worse, noisy = document(), document()
    worse["unexplained"][worse["stage"]]["held_out"] = 2 * worse["unexplained"]["conductance"]["held_out"]
    for stage, left in (("conductance", 2e-4), (noisy["stage"], 4e-4)):  # both of noise, which is no fault of the fit
        noisy["unexplained"][stage]["held_out"] = left
    for one, cautions in ((document(), 0), (noisy, 0), (worse, 1)):
        write_json(one, tmp_path / "sensor.json")
        assert len(sensor_report.report(tmp_path / "sensor.json").cautions) == cautions
