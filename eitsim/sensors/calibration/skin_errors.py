"""What the calibrated sensor's own error makes of the signals of presses, in the same way in all of them.

A state drawn from the calibration, its uneven sheet with it, changes the signal of a press by as much as that of a
small touch of the same size there. Above all the untouched frame hardly sees electrodes that move along the rim as a
conformal map of the disc onto itself has it, and presses then seem to lie elsewhere.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from eitsim.electrics.imaging.gauss_newton import pixel_signals, pixels_of
from eitsim.scene.scene import Scene
from eitsim.sensors.calibration.instrument_model import Instrument
from eitsim.sensors.calibration.stages import Fit
from touchcal.arrays import Array

_DRAWS = 16
_RINGS = 12  # of pixels
_REACH = 0.5  # of a press's change of conductance, one standard deviation, over the punch's diameter


def errors_of_instrument(instrument: Instrument, fit: Fit, scene: Scene, signal: Array, seed: int) -> Array:
    """(draws, k, m) V what states that the calibration may have missed add to the signals (k, m) of a scene's punches
    on its even sheet."""
    mosaic = pixels_of(scene.body, _RINGS)
    place = np.array([[punch.x_m, punch.y_m] for punch in scene.punches])
    reach = _REACH * np.array([punch.diameter_m for punch in scene.punches])
    away = np.sum((mosaic.centre_m - place[:, None]) ** 2, axis=2)
    weight = np.exp(-away / (2 * reach[:, None] ** 2)) * mosaic.area_m2

    def small(state: Array, *, even: bool) -> Array:
        channels = instrument.channels(state)
        channels = replace(channels, sheet_modes=()) if even else channels
        return pixel_signals(scene.body, instrument.built(state), scene.drive, channels, mosaic, weight).T

    chance = np.random.default_rng(seed)
    states = chance.multivariate_normal(fit.state, fit.covariance, _DRAWS, method="svd")
    here = small(fit.state, even=True)
    size = np.sum(signal * here, axis=1) / np.sum(here**2, axis=1)
    out = []
    for state in states:
        with suppress(ValueError):  # electrodes that overlap are no sensor's
            out.append(size[:, None] * (small(state, even=False) - here))
    return np.reshape(out, (-1, *signal.shape))
