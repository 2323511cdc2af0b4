"""A sensor with an outline: what its calibration recovers, writes and refuses, and where the calibrated one serves.

Readings are synthetic, by meshes made for the hidden electrodes, which no fit takes.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Polygon

from eitsim.electrics.forward.small_touch import signal_by_touch
from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.electrics.outline.adapted_mesh import solve_untouched
from eitsim.scene.drive import Drive
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Scene, read_scene
from eitsim.sensors.calibration.calibrate import Calibration, calibrate
from eitsim.sensors.calibration.calibration_file import (
    CalibratedSensor,
    calibration_document,
    parameters_of,
    read_calibration,
)
from eitsim.sensors.calibration.ideal_frames import ideal_frames, to_ideal
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, instrument_readings, sources
from eitsim.sensors.calibration.stages import Fit, Stage
from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor
from reports.sensor import sensor_report
from touchcal.errors import InputFileError
from touchcal.json_file import write_json

COUNT, SHEET_S, NOISE = 8, 8e-4, 3e-4
CORNERS = ((-0.06, -0.06), (0.06, -0.06), (0.06, 0.0), (0.0, 0.0), (0.0, 0.06), (-0.06, 0.06))
BODY = Body(Outline("polygon", points_m=CORNERS, holes_m=((-0.02, -0.03, 0.008),)))
HIDDEN = {"contacts": 0.3, "widths": 0.05, "positions": 0.5e-3, "gains": 0.03, "leaks": 30e-6}


def described(body: Body = BODY, electrodes: Electrodes | None = None) -> Sensor:
    """Drives to the next but one and to the opposite electrode, both ways; readings between neighbours."""
    unit = np.eye(COUNT)
    ends = [(k, (k + step) % COUNT) for step in (2, COUNT // 2, COUNT - 2) for k in range(COUNT)]
    scene = Scene(body=body, electrodes=electrodes or Electrodes(count=COUNT), drive=Drive(
        1e-3, currents=tuple(unit[a] - unit[b] for a, b in ends), measurements=tuple(unit[:-1] - unit[1:])))
    return Sensor(scene.body, scene.skin, scene.electrodes, scene.drive)


@dataclass(frozen=True)
class Known:
    """A hidden sensor: what it is and what it reads."""

    state: np.ndarray
    clean: np.ndarray
    recording: Recording


def recorded(frames: np.ndarray, touch: list[str]) -> Recording:
    return Recording(frames, np.arange(len(frames)), None, np.array(touch), "voltage", Path("synthetic"))


def read_back(found: Calibration, folder: Path) -> CalibratedSensor:
    write_json(calibration_document(found), folder / "sensor.json")
    return read_calibration(folder / "sensor.json")


@lru_cache(maxsize=1)
def hidden() -> Known:
    """Contacts unequal by 30 %, places, widths, gains and leaks as sensors have them; readings by a mesh of its own."""
    rng, one = np.random.default_rng(4), described()
    held = Instrument(one.body, one.electrodes, sources(one.protocol), SHEET_S)
    change = np.zeros(held.size)
    for group, size in HIDDEN.items():
        change[held.places[group]] = size * rng.standard_normal(COUNT)
    change[held.places["leaks"]] = np.abs(change[held.places["leaks"]])
    state = held.prior_mean + held.gauged(change)
    body = solve_untouched(BODY.outline, held.built(state), SHEET_S, 1e-5).impedance_Ohm
    clean = instrument_readings(held, one.protocol, state, np.asarray(np.linalg.pinv(body), dtype=float)).ravel()
    noise = NOISE * np.sqrt(np.mean(clean**2)) * rng.standard_normal((4, clean.size))
    return Known(state, clean, recorded(clean + noise, [""] * 4))


@lru_cache(maxsize=1)
def calibrated() -> Calibration:
    return calibrate(described(), hidden().recording)


@pytest.mark.slow
def test_hidden_parameters_lie_within_their_intervals_and_readings_within_the_noise(tmp_path: Path) -> None:
    found = calibrated()
    assert found.reason == ""
    assert found.instrument is not None
    assert found.fit is not None
    fitted = parameters_of(found)
    value, sd, prior = (np.array([one[key] for one in fitted.values()]) for key in ("value", "sd", "prior_sd"))
    off = (value - hidden().state * found.instrument.units) / sd
    inside = np.abs(off) < 1.96
    print({group: f"{inside[own].sum()} of {inside[own].size}" for group, own in found.instrument.places.items()})
    assert inside.mean() > 0.9
    assert np.abs(off).max() < 4
    contacts = found.instrument.places["contacts"]
    assert np.median((sd / prior)[contacts]) < 0.21
    missed = read_back(found, tmp_path).readings().ravel() - hidden().clean
    assert np.sqrt(np.mean(missed**2)) < NOISE * np.sqrt(np.mean(hidden().clean**2))


def stated(**offsets_mm: float) -> Calibration:
    """A calibration whose state is the prior mean but for the places of some electrodes, without a fit."""
    one = described()
    held = Instrument(one.body, one.electrodes, sources(one.protocol), SHEET_S)
    state = held.prior_mean
    for name, offset in offsets_mm.items():
        state[held.places["positions"].start + int(name.removeprefix("e"))] = 1e-3 * offset
    state[held.places["sheet"]] = [0.02, -0.01, 0.03, 0.0, 0.01]
    return Calibration(one, 1, None, instrument=held.around(state), kept=tuple(GROUPS),
                       fit=Fit(state, 1e-6, 0.0, np.diag(1e-4 * held.prior_sd**2)))


def test_a_scene_takes_the_calibrated_electrodes_along_its_outline(tmp_path: Path) -> None:
    write_json(calibration_document(stated(e3=1.5, e6=-0.5)), tmp_path / "sensor.json")
    (tmp_path / "scene.toml").write_text('[electrodes]\ncalibrated = "sensor.json"\n', encoding="utf-8")
    scene = read_scene(tmp_path / "scene.toml")
    assert scene.body == BODY
    even = 0.48 * np.arange(COUNT) / COUNT
    assert np.array(scene.electrodes.positions_m) - even == pytest.approx(
        1e-3 * np.array([0, 0, 0, 1.5, 0, 0, -0.5, 0]), abs=1e-9)
    assert scene.channels.conductance_S == pytest.approx((SHEET_S,))
    flat = replace(scene, channels=replace(scene.channels, sheet_modes=()))
    assert np.isfinite(untouched_readings(flat, SHEET_S)).all()
    own = read_calibration(tmp_path / "sensor.json")
    assert own.instrument.built(own.state).positions_m == pytest.approx(scene.electrodes.positions_m)


@pytest.mark.parametrize(("line", "words"), [
    ("radius_mm = 50", "radius_mm in [body] must be that of the calibrated sensor, which has none"),
    ('outline = "rectangle"', "outline in [body] must be that of the calibrated sensor, 'polygon'")])
def test_another_outline_than_the_calibrated_one_is_refused_by_name(tmp_path: Path, line: str, words: str) -> None:
    write_json(calibration_document(stated()), tmp_path / "sensor.json")
    (tmp_path / "scene.toml").write_text(f'[body]\n{line}\n[electrodes]\ncalibrated = "sensor.json"\n',
                                         encoding="utf-8")
    with pytest.raises(InputFileError) as caught:
        read_scene(tmp_path / "scene.toml")
    assert words in str(caught.value)


def test_its_report_draws_the_outline(tmp_path: Path) -> None:
    found = replace(stated(e3=1.5), stages={group: Stage(0.01, 0.01, kept=True) for group in GROUPS},
                    by_electrode=(0.01,) * COUNT)
    write_json(calibration_document(found), tmp_path / "sensor.json")
    report = sensor_report.report(tmp_path / "sensor.json")
    assert report.subtitle.startswith("8 electrodes along the edge of a skin of")
    electrodes = next(plate for plate in report.plates if plate.name == "electrodes")
    axes = electrodes.figure.axes[0]
    outer, hole = axes.patches
    assert isinstance(outer, Polygon)
    assert isinstance(hole, Polygon)
    np.testing.assert_allclose(np.ptp(np.array(outer.get_xy()), axis=0), [120, 120])
    assert [text.get_text() for text in axes.texts][:COUNT] == [str(k) for k in range(COUNT)]
    assert "Lines: ln of the sheet conductance" in electrodes.caption


def test_electrodes_on_the_surface_are_refused_by_name() -> None:
    grid = Electrodes(kind="surface", count=COUNT, x_m=(-0.04,) * 4 + (-0.02, 0.0, 0.02, 0.04),
                      y_m=(-0.02, 0.0, 0.02, 0.04, -0.05, -0.05, -0.05, -0.05), width_m=0.008)
    with pytest.raises(ValueError, match="not built for electrodes on the surface"):
        calibrate(described(electrodes=grid), hidden().recording)


PLACES = 1e-3 * np.array([[-40, -40], [-40, -20], [-45, 0], [-30, 20], [-20, 40], [-10, -45], [10, -40], [30, -20],
                          [40, -40], [15, -15], [-45, 40], [-15, 10]])


NAMES = np.array([f"p{k}" for k in range(len(PLACES))])


def presses() -> Recording:
    """What light presses at PLACES change of the readings of the sensor as its file describes it."""
    one = described()
    signal = -20e-6 * signal_by_touch(one.body, one.electrodes, SHEET_S, one.scene.channels, one.protocol, PLACES)
    return Recording(signal, np.arange(len(PLACES)), None, NAMES, "difference", Path("synthetic"))


@pytest.mark.parametrize("turned", [False, True])
def test_labels_in_other_coordinates_are_placed_on_the_outline(turned: bool) -> None:
    """Mirrored about a diagonal and shifted; an L with an uneven hole looks like itself from one side alone. Of
    differences the size is by a sheet of 1 mS, since nothing says which it has."""
    given = PLACES
    if turned:
        given = PLACES[:, ::-1] + np.array([0.2, -0.1])
    labels = Labels(NAMES, ("x_mm", "y_mm"), 1e3 * given)
    found = calibrate(replace(described(), kind="difference"), presses(), labels)
    assert found.size is not None
    assert found.size.held_out < 0.05
    np.testing.assert_allclose(found.size.lies.placed(given), PLACES, atol=1e-3 if turned else 1e-4)
    assert np.exp(found.size.ln_moment[0]) == pytest.approx(20.0 * 1e-3 / SHEET_S, rel=0.02)


@pytest.mark.slow
def test_corrected_frames_are_those_of_the_described_sensor(tmp_path: Path) -> None:
    own = read_back(stated(e3=1.5), tmp_path)
    found = to_ideal(own)
    frames = ideal_frames(found, own, recorded(np.tile(own.readings().ravel(), (2, 1)), ["", "p0"]))
    np.testing.assert_allclose(frames.readings[1], untouched_readings(own.sensor.scene, SHEET_S), rtol=1e-9)
    assert 0 < found.left < 0.2
