"""What the calibration's own error makes of presses: nothing where it is sure, and in the same way in all of them."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.imaging.gauss_newton import pixel_signals, pixels
from eitsim.scene.channels import Channels
from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Punch, Scene
from eitsim.sensors.calibration.instrument_model import Instrument, sources
from eitsim.sensors.calibration.skin_errors import errors_of_instrument
from eitsim.sensors.calibration.stages import Fit
from eitsim.sensors.sensor_file import Sensor

BODY, ELECTRODES, DRIVE = Body(), Electrodes(count=8), Drive(1e-3, "skip-1", "differential")
SENSOR = Sensor(BODY, Scene().skin, ELECTRODES, DRIVE)
HELD = Instrument(BODY, ELECTRODES, sources(SENSOR.protocol), 6e-4)
PUNCHES = (Punch(0.03, 0.0), Punch(-0.02, 0.04))


def pressed() -> np.ndarray:
    """Signals (2, m) of touches at the punches, to first order."""
    mosaic = pixels(BODY.radius_m, 6)
    by_pixel = pixel_signals(BODY, ELECTRODES, DRIVE, Channels(conductance_S=(6e-4,)), mosaic)
    near = [np.argmin(np.hypot(*(mosaic.centre_m - [one.x_m, one.y_m]).T)) for one in PUNCHES]
    return by_pixel[:, near].T


def errors(covariance: np.ndarray) -> np.ndarray:
    scene = replace(SENSOR.scene, punches=PUNCHES)
    return errors_of_instrument(HELD, Fit(HELD.prior_mean, 1e-6, 0.0, covariance), scene, pressed(), 0)


def test_sums_of_pixels_are_those_of_their_signals() -> None:
    channels = Channels((1.01,) * 8, (1.0,) * 8, (1e-5,) * 8, (6e-4,), (0.05, 0.02, 0.0, 0.01, 0.03))
    mosaic = pixels(BODY.radius_m, 5)
    weight = np.random.default_rng(0).uniform(size=(3, len(mosaic.area_m2)))
    whole = pixel_signals(BODY, ELECTRODES, DRIVE, channels, mosaic)
    summed = pixel_signals(BODY, ELECTRODES, DRIVE, channels, mosaic, weight)
    np.testing.assert_allclose(summed, whole @ weight.T, atol=1e-12 * np.abs(whole).max())


@pytest.mark.thorough
def test_a_sensor_that_is_known_adds_nothing() -> None:
    assert np.abs(errors(np.zeros((HELD.size, HELD.size)))).max() < 1e-9 * np.abs(pressed()).max()


@pytest.mark.thorough
def test_a_conductance_in_doubt_scales_all_presses_in_the_same_way() -> None:
    """Signals go with the inverse of the sheet's conductance."""
    doubt = np.zeros((HELD.size, HELD.size))
    own = HELD.places["conductance"]
    doubt[own, own] = 0.02**2
    found = errors(doubt)
    scale = np.sum(found * pressed(), axis=2) / np.sum(pressed() ** 2, axis=1)
    np.testing.assert_allclose(scale[:, 0], scale[:, 1], atol=2e-3)
    assert 0.01 < np.std(scale) < 0.04


@pytest.mark.thorough
def test_draws_whose_electrodes_overlap_are_left_out() -> None:
    wide = np.zeros((HELD.size, HELD.size))
    wide[HELD.places["width"], HELD.places["width"]] = 3.0**2
    found = errors(wide)
    assert found.shape[1:] == pressed().shape
    assert 0 < len(found) < 16
