"""Labelled presses: the field of a small touch, the signal's size, and gains of readings where no model is usable."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.small_touch import signal_by_touch
from eitsim.scene.channels import Channels, channel_readings
from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Skin
from eitsim.sensors.calibration.calibrate import calibrate
from eitsim.sensors.calibration.calibration_file import calibration_document, parameters_of
from eitsim.sensors.calibration.labelled_presses import labelled_presses
from eitsim.sensors.calibration.placement import Placement, placement
from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor, read_sensor

SENSOR = Sensor(Body(), Skin(), Electrodes(count=8), Drive(1e-3, "skip-1", "differential"))
CHANNELS = Channels(tuple(np.linspace(0.97, 1.03, 8).tolist()), (), (2e-5,) * 8, (6e-4,))
PLACES = 60.0 * np.random.default_rng(0).uniform(-1, 1, (24, 2))


def labels(count: int = len(PLACES)) -> Labels:
    return Labels(np.array([f"p{k}" for k in range(count)]), ("x_mm", "y_mm"), PLACES[:count])


def recorded(signal: np.ndarray, rest: np.ndarray, kind: str) -> Recording:
    """An untouched frame, then a frame a press."""
    frames = signal if kind == "difference" else np.vstack([rest, rest + signal])
    names = [f"p{k}" for k in range(len(signal))]
    return Recording(frames, np.arange(len(frames)), None, np.array(names if kind == "difference" else ["", *names]),
                     kind, Path("synthetic"))


def signals(channels: Channels, moments_mm2: np.ndarray) -> np.ndarray:
    return 1e-6 * moments_mm2[:, None] * signal_by_touch(SENSOR.body, SENSOR.electrodes, 6e-4, channels,
                                                         SENSOR.protocol, 1e-3 * PLACES)


def test_a_small_touch_is_what_the_simulator_makes_of_a_light_one() -> None:
    """A press of 4 mm whose signal has the pattern of a point's, to a few per cent."""
    foam = matcal.Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm")
    law = matcal.Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0, 0.4))
    card = matcal.MaterialCard("foam", foam, conductivity=law)
    punch = eitsim.Punch(x_m=0.03, y_m=-0.02, diameter_m=0.004, force_N=0.01)
    scene = replace(SENSOR.scene, punches=(punch,))
    found = eitsim.simulate(scene, card).readings
    assert found is not None
    point = signal_by_touch(SENSOR.body, SENSOR.electrodes, 6e-4, Channels(), SENSOR.protocol,
                            np.array([[0.03, -0.02]]))[0]
    signal = found.signal_V.ravel()
    likeness = abs(signal @ point) / (np.linalg.norm(signal) * np.linalg.norm(point))
    print(f"cosine {likeness:.5f}")
    assert likeness > 0.995


@pytest.mark.slow
def test_the_size_of_the_signal_is_recovered_within_its_interval() -> None:
    """A calibrated sensor with unequal gains and leaks, and presses whose sizes spread by a tenth."""
    rng = np.random.default_rng(1)
    sizes = 20.0 * np.exp(0.1 * rng.standard_normal(len(PLACES)))
    unit = np.eye(8)
    asked = Drive(1e-3, currents=tuple(unit[k] - unit[(k + step) % 8] for step in (2, 4, 6) for k in range(8)),
                  measurements=tuple(unit[:-1] - unit[1:]))
    one = replace(SENSOR, drive=asked)
    rest = channel_readings(one.protocol, CHANNELS, solve_rim(one.body, one.electrodes, 6e-4).impedance_Ohm).ravel()
    signal = -1e-6 * sizes[:, None] * signal_by_touch(one.body, one.electrodes, 6e-4, CHANNELS, one.protocol,
                                                      1e-3 * PLACES)
    noise = 1e-5 * np.sqrt(np.mean(rest**2)) * rng.standard_normal((len(PLACES) + 1, rest.size))
    frames = recorded(signal + noise[1:], rest + noise[0], "voltage")
    found = calibrate(one, frames, labels())
    assert found.reason == ""
    assert found.size is not None
    assert found.size.sign == -1
    fitted = parameters_of(found)["ln_moment_mm2"]
    assert fitted["sd"] < 0.05
    assert fitted["value"] == pytest.approx(np.log(20.0), abs=3 * fitted["sd"])
    assert found.size.held_out < 0.05
    assert not any(name.startswith("reading_gain") for name in parameters_of(found))


@pytest.mark.parametrize("rectified", [False, True])
def test_differences_are_calibrated_for_changes_alone(rectified: bool) -> None:
    """Gains of readings by chance, of signed readings and of magnitudes: what explains more says which they are."""
    rng = np.random.default_rng(2)
    gain = 1 + 0.3 * rng.standard_normal(SENSOR.protocol.weights.reshape(-1, 8).shape[0])
    sign = np.sign(channel_readings(SENSOR.protocol, Channels(), solve_rim(
        SENSOR.body, SENSOR.electrodes, 6e-4).impedance_Ohm).ravel()) if rectified else 1.0
    one = replace(SENSOR, kind="difference")
    signal = sign * gain * signals(Channels(), 30.0 * np.exp(0.2 * rng.standard_normal(len(PLACES))))
    found = calibrate(one, recorded(signal, signal[0], "difference"), labels())
    assert found.size is not None
    assert found.size.gains_kept
    assert found.size.held_out_gains < 0.1 < found.size.held_out
    np.testing.assert_allclose(found.size.gain, gain / gain.mean(), atol=0.1)
    document = calibration_document(found)
    assert document["kind"] == "changes only"
    assert document["parameters"]["reading_gain_000"]["prior_sd"] == 0.3
    assert document["parameters"]["reading_gain_000"]["sd"] < 0.3


def test_gains_that_do_not_help_presses_that_were_not_fitted_are_left_out() -> None:
    """Signals of noise alone."""
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((len(PLACES), SENSOR.protocol.weights.reshape(-1, 8).shape[0]))
    found = calibrate(replace(SENSOR, kind="difference"), recorded(noise, noise[0], "difference"), labels())
    assert found.size is not None
    assert not found.size.gains_kept
    assert set(found.size.gain.tolist()) == {1.0}


def test_labels_without_places_or_of_other_touches_are_refused() -> None:
    one = replace(SENSOR, kind="difference")
    frames = recorded(signals(Channels(), np.ones(len(PLACES))), np.zeros(1), "difference")
    with pytest.raises(ValueError, match="places need x_mm and y_mm"):
        calibrate(one, frames, Labels(np.array(["p0"]), ("F_N",), np.ones((1, 1))))
    with pytest.raises(ValueError, match="2 touches of the recording have a label, and 4 are the fewest"):
        calibrate(one, frames, labels(2))


def test_stuck_readings_do_not_count_as_presses() -> None:
    rest = channel_readings(SENSOR.protocol, Channels(), solve_rim(SENSOR.body, SENSOR.electrodes, 6e-4).impedance_Ohm)
    one = signals(Channels(), 30.0 * np.ones(len(PLACES)))
    frames = recorded(one, rest.ravel(), "voltage")
    frames.readings[:, 7] = 0.3
    found = labelled_presses(frames, labels())
    assert np.isnan(found.signal[:, 7]).all()
    assert np.isfinite(np.delete(found.signal, 7, axis=1)).all()


def test_a_press_that_others_place_off_the_disc_is_named() -> None:
    """Only a hundred of the presses are searched with; the wrong label is none of these."""
    radius, angle = 40.0 * np.sqrt(np.linspace(0, 1, 150)), 2.4 * np.arange(150)
    places = 1e-3 * np.column_stack([55.0 + radius * np.cos(angle), radius * np.sin(angle)])

    def shape(at: np.ndarray) -> np.ndarray:
        return signal_by_touch(SENSOR.body, SENSOR.electrodes, 6e-4, Channels(), SENSOR.protocol, at)

    signal, labelled = shape(places), places - [0.055, 0.0]
    labelled[2] = [0.038, 0.038]
    assert 2 not in np.linspace(0, 149, 100).astype(int)
    with pytest.raises(ValueError, match=r"the press at 38, 38 mm lies .* mm off the skin"):
        placement(labelled, signal, shape, SENSOR.body)


def test_a_refused_model_is_written_for_changes_and_read_as_a_sensor(
        command: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    signal = signals(Channels(), 30.0 * np.ones(len(PLACES)))
    columns = ",".join(["touch", *(f"v_{k:03d}" for k in range(signal.shape[1]))])
    rows = [",".join([f"p{k}", *map(repr, row)]) for k, row in enumerate(signal.tolist())]
    (tmp_path / "frames.csv").write_text("\n".join([columns, *rows]) + "\n", encoding="utf-8")
    (tmp_path / "touches.csv").write_text("touch,x_mm,y_mm\n" + "".join(
        f"p{k},{x!r},{y!r}\n" for k, (x, y) in enumerate(PLACES.tolist())), encoding="utf-8")
    (tmp_path / "sensor.toml").write_text('[electrodes]\ncount = 8\n[drive]\ncurrent_mA = 1\npattern = "skip-1"\n'
                                          'reading = "differential"\n[readings]\nkind = "difference"\n',
                                          encoding="utf-8")
    done = command("eitsim", "sensor", "fit", "frames.csv", "--labels", "touches.csv", "--sensor", "sensor.toml",
                   "--out", "sensor.json", "--report", "sensor.pdf", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert (said["absolute_model"], said["kind"], said["stage"]) == ("refused", "changes only", None)
    assert "differences" in said["reason"]
    assert said["presses"]["count"] == len(PLACES)
    assert (tmp_path / "sensor.pdf").read_bytes().startswith(b"%PDF")
    assert read_sensor(tmp_path / "sensor.json") == read_sensor(tmp_path / "sensor.toml")


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_sensor_is_found_in_the_labels_coordinates(mirrored: bool) -> None:
    """Labels of a robot: another centre, turned, and counting the other way."""
    point = (PLACES @ np.array([1.0, 1j])) * np.exp(-1j * 0.7)
    point = (point.conj() if mirrored else point) + (400 - 300j)
    robot = Labels(labels().touch, labels().names, np.column_stack([point.real, point.imag]))
    found = calibrate(replace(SENSOR, kind="difference"), recorded(signals(Channels(), 30.0 * np.ones(len(PLACES))),
                                                                   np.zeros(1), "difference"), robot)
    assert found.size is not None
    lies = found.size.lies
    assert lies.mirrored == mirrored
    assert np.hypot(lies.centre_m[0] - 0.4, lies.centre_m[1] + 0.3) < 2e-3
    assert np.abs(np.exp(1j * (lies.turn_rad - 0.7)) - 1) < 0.03
    assert found.size.held_out < 0.1


def test_labels_in_the_sensor_s_own_coordinates_are_kept_there() -> None:
    found = calibrate(replace(SENSOR, kind="difference"), recorded(signals(Channels(), 30.0 * np.ones(len(PLACES))),
                                                                   np.zeros(1), "difference"), labels())
    assert found.size is not None
    assert found.size.lies == Placement()


def test_places_that_do_not_fit_into_the_body_are_refused() -> None:
    wide = Labels(labels().touch, labels().names, 3 * PLACES)
    with pytest.raises(ValueError, match="mm from the middle of their range, and radius_mm"):
        calibrate(replace(SENSOR, kind="difference"), recorded(signals(Channels(), np.ones(len(PLACES))), np.zeros(1),
                                                               "difference"), wide)
