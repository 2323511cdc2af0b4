"""Frames corrected to the ideal sensor: touches of a real one become those of the ideal one, noise is not blown up."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.small_touch import signal_by_touch
from eitsim.scene.channels import Channels, channel_readings
from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Skin
from eitsim.sensors.calibration.calibrate import Calibration
from eitsim.sensors.calibration.calibration_file import CalibratedSensor, calibration_document
from eitsim.sensors.calibration.ideal_frames import (
    changed_since,
    frame_noise,
    ideal_frames,
    live_readings,
    to_ideal,
)
from eitsim.sensors.calibration.instrument_model import Instrument, sources, voltages
from eitsim.sensors.calibration.stages import Fit
from eitsim.sensors.recording import Recording, read_recording, write_recording
from eitsim.sensors.sensor_file import Sensor
from touchcal.errors import InputFileError
from touchcal.json_file import write_json

UNIT = np.eye(8)
SENSOR = Sensor(Body(), Skin(), Electrodes(count=8), Drive(1e-3, currents=tuple(
    UNIT[k] - UNIT[(k + step) % 8] for step in (2, 4) for k in range(8)), measurements=tuple(UNIT[:-1] - UNIT[1:])))
HELD = Instrument(SENSOR.body, SENSOR.electrodes, sources(SENSOR.protocol), 1e-3)
PLACES_M = 0.06 * np.random.default_rng(0).uniform(-1, 1, (12, 2))
SIZE_M2 = 34e-6


def real(*groups: str) -> CalibratedSensor:
    rng, state = np.random.default_rng(1), HELD.prior_mean
    for group in groups:
        own = HELD.places[group]
        state[own] += {"contacts": 0.5}.get(group, 1.0) * HELD.prior_sd[own] * rng.standard_normal(own.stop - own.start)
    return CalibratedSensor(SENSOR, HELD, state, 2e-5, 0.1 * HELD.prior_sd)


def touched(sensor: CalibratedSensor) -> np.ndarray:
    """(12, m) signals of small touches on a calibrated sensor, without its uneven sheet."""
    channels = sensor.instrument.channels(sensor.state)
    return SIZE_M2 * signal_by_touch(SENSOR.body, HELD.built(sensor.state), channels.conductance_S[0], channels,
                                     SENSOR.protocol, PLACES_M)


def recording(sensor: CalibratedSensor) -> Recording:
    rest = sensor.readings().ravel()
    names = np.array(["", *(f"p{k}" for k in range(len(PLACES_M)))])
    return Recording(np.vstack([rest, rest + touched(sensor)]), np.arange(len(names)), None, names, "voltage",
                     Path("synthetic"))


def test_signals_become_those_of_the_ideal_sensor() -> None:
    """Gains, leaks, contacts and places; signals as read are five times further off."""
    sensor = real("contacts", "gains", "leaks", "positions")
    ideal = touched(real())
    found = ideal_frames(to_ideal(sensor), sensor, recording(sensor))
    rest = channel_readings(SENSOR.protocol, Channels(conductance_S=(1e-3,)),
                            solve_rim(SENSOR.body, SENSOR.electrodes, 1e-3).impedance_Ohm).ravel()
    np.testing.assert_allclose(found.readings[0], rest, atol=1e-6 * float(np.abs(rest).max()))
    signal = found.readings[1:] - found.readings[0]
    off, before = (np.linalg.norm(one - ideal) / np.linalg.norm(ideal) for one in (signal, touched(sensor)))
    print(f"off by {off:.2%} corrected, {before:.2%} as read")
    assert off < before / 5


@pytest.mark.parametrize(("times", "answer"), [(1.0, ""), (1.1, "10 %"), (1000.0, "1e+03 times"), (-1.0, "-1 times"),
                                                   ("turned", "another order")])
def test_a_recording_of_another_unit_or_order_is_not_corrected(times: float | str, answer: str) -> None:
    sensor = real("contacts", "gains")
    read = recording(sensor)
    frames = np.roll(read.readings, 21, axis=1) if times == "turned" else float(times) * read.readings
    given = replace(read, readings=frames)
    if answer in ("", "10 %"):
        said = changed_since(sensor, given, live_readings(given))
        assert answer.replace(" ", "") in said
        assert bool(said) == bool(answer)
        return
    with pytest.raises(InputFileError) as refused:
        changed_since(sensor, given, live_readings(given))
    assert answer in str(refused.value)


@pytest.mark.parametrize("dead", ["one empty", "an electrode stuck"])
def test_dead_readings_are_made_up_for_by_the_others(dead: str) -> None:
    sensor = real("contacts", "gains", "leaks", "positions")
    read = recording(sensor)
    frames = read.readings.copy()
    if dead == "one empty":
        frames[3, 5] = np.nan
    else:
        frames[:, 3::7] = 0.25
    read = replace(read, readings=frames)
    found = ideal_frames(to_ideal(sensor, live_readings(read)), sensor, read)
    ideal, signal = touched(real()), found.readings[1:] - found.readings[0]
    assert np.linalg.norm(signal - ideal) < 0.05 * np.linalg.norm(ideal)


def test_the_ideal_sensor_is_left_as_it_is() -> None:
    sensor = real()
    found = to_ideal(sensor)
    np.testing.assert_allclose(found.matrix, np.eye(len(found.matrix)), atol=1e-9)
    assert found.left < 1e-9


def test_noise_is_not_blown_up() -> None:
    """A map of noise-free least squares would make of it a multiple."""
    found = to_ideal(real("contacts", "gains", "leaks", "positions"))
    noise = np.random.default_rng(2).standard_normal((200, len(found.matrix)))
    assert np.linalg.norm(noise @ found.matrix.T) < 1.5 * np.linalg.norm(noise)


@pytest.mark.slow
def test_what_the_calibration_may_have_missed_is_in_the_error() -> None:
    """Sensors about the calibrated one add to what the map itself misses."""
    sensor = real("gains")
    found = to_ideal(sensor)
    surer = replace(sensor, sd=0.01 * HELD.prior_sd)
    assert frame_noise(sensor, found) > frame_noise(surer, found) > np.sqrt(2) * sensor.misfit


def test_a_recording_without_untouched_frame_is_refused() -> None:
    sensor = real()
    one = recording(sensor)
    with pytest.raises(InputFileError, match="no frame is untouched"):
        ideal_frames(to_ideal(sensor), sensor, Recording(one.readings[1:], one.index[1:], None, one.touch[1:], one.kind,
                                                         one.source))


@pytest.mark.slow
def test_the_command_writes_a_recording(command: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    sensor = real("gains", "leaks")
    covariance = np.diag(1e-4 * HELD.prior_sd**2)
    write_json(calibration_document(Calibration(SENSOR, 1, None, instrument=HELD, fit=Fit(
        sensor.state, sensor.misfit, 0.0, covariance))), tmp_path / "sensor.json")
    write_recording(recording(sensor), tmp_path / "frames.csv")
    again = read_recording(tmp_path / "frames.csv")
    np.testing.assert_allclose(again.readings, recording(sensor).readings, rtol=1e-15)
    done = command("eitsim", "sensor", "correct", "frames.csv", "--sensor", "sensor.json", "--out", "corrected.csv",
                   cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = read_recording(tmp_path / "corrected.csv")
    assert found.touch.tolist() == recording(sensor).touch.tolist()
    expected = voltages(HELD, SENSOR.protocol, HELD.prior_mean).ravel()
    np.testing.assert_allclose(found.readings[0], expected, atol=1e-5 * float(np.abs(expected).max()))


@pytest.mark.thorough
def test_the_noise_does_not_hang_on_the_draw() -> None:
    """Leaks so uncertain that some of the drawn sensors give back energy, which no body does."""
    sensor = real("gains")
    leaks = np.zeros(HELD.size)
    leaks[HELD.places["leaks"]] = 100 * HELD.prior_sd[HELD.places["leaks"]]
    unsure = replace(sensor, sd=leaks)
    found = to_ideal(unsure)
    drawn = [frame_noise(unsure, found, seed) for seed in range(6)]
    assert max(drawn) < 3 * min(drawn)
