"""Dead electrodes and channels that no model explains are named, and what is left is calibrated without them."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Skin
from eitsim.sensors.calibration.calibrate import calibrate
from eitsim.sensors.calibration.calibration_file import calibration_document
from eitsim.sensors.calibration.instrument_model import Instrument, sources, voltages
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor

COUNT = 8
UNIT = np.eye(COUNT)
SENSOR = Sensor(Body(), Skin(), Electrodes(count=COUNT), Drive(1e-3, currents=tuple(
    UNIT[k] - UNIT[(k + step) % COUNT] for step in (2, 4, 6) for k in range(COUNT)),
    measurements=tuple(UNIT[:-1] - UNIT[1:])))


def frame(seed: int) -> np.ndarray:
    """(24, 7) readings of a sensor with unlike contacts, 80 dB above white noise."""
    held, rng = Instrument(Body(), SENSOR.electrodes, sources(SENSOR.protocol), 1e-3), np.random.default_rng(seed)
    state = held.prior_mean
    state[held.places["contacts"]] = rng.standard_normal(COUNT)
    clean = voltages(held, SENSOR.protocol, state)
    return clean + 1e-4 * np.sqrt(np.mean(clean**2)) * rng.standard_normal(clean.shape)


def recording(volts: np.ndarray) -> Recording:
    return Recording(volts.reshape(1, -1), np.array([0]), None, np.array([""]), "voltage", Path("synthetic"))


@pytest.mark.slow
def test_a_dead_electrode_is_named_and_its_drives_are_left_out() -> None:
    """Its readings are empty; its drives, in which no current flows, read noise alone."""
    volts = frame(0)
    drives = SENSOR.protocol.currents_A[:, 3] != 0
    volts[drives] = 1e-6 * np.random.default_rng(1).standard_normal((int(drives.sum()), COUNT - 1))
    volts[:, [2, 3]] = np.nan
    found = calibrate(SENSOR, recording(volts))
    assert found.reason == ""
    assert list(found.left_out) == [3]
    assert calibration_document(found)["left_out"] == {"3": "100% of the readings at it are dead"}
    assert len(found.dead) == 2 * len(volts)
    assert found.by_electrode[3] == 0.0
    assert max(found.by_electrode) < 1e-3


@pytest.mark.slow
def test_a_channel_that_no_model_explains_is_left_out() -> None:
    """The amplifier of electrode 5 gives what it likes; without that electrode the others are explained."""
    volts = frame(2)
    volts[:, [4, 5]] += 0.5 * np.sqrt(np.mean(volts**2)) * np.random.default_rng(3).standard_normal((len(volts), 2))
    found = calibrate(SENSOR, recording(volts))
    assert list(found.left_out) == [5]
    assert found.reason == ""
    assert "no state of the model explains it" in found.left_out[5]
    assert found.fit is not None
    assert found.fit.misfit < 3e-4 * np.sqrt(np.mean(volts**2))


@pytest.mark.slow
def test_a_sensor_without_faults_leaves_nothing_out() -> None:
    found = calibrate(SENSOR, recording(frame(4)))
    assert (found.left_out, found.dead) == ({}, ())
