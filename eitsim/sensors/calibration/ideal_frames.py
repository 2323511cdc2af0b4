"""Frames of a calibrated sensor as the sensor of its file would read them, so that models of that one serve.

A small touch at x changes the readings of the real sensor by J_r(x) and those of the ideal one by J_i(x), for a unit of
its size. M = 1 + (J_i - J_r) J_r' (J_r J_r' + n^2)^-1, means over pixels of the skin, n the noise of a change, is the
least-squares map from one to the other that leaves alone what lies in the noise: V_ideal = V0_ideal + M (V - V0). What
it misses, also of sensors that the calibration may have missed, is the covariance of its error (Bayesian approximation
error).
"""

from dataclasses import dataclass, replace

import numpy as np

from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.imaging.gauss_newton import pixel_signals, pixels_of
from eitsim.scene.channels import Channels, channel_readings
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import from_edge_m
from eitsim.sensors.calibration.calibration_file import CalibratedSensor
from eitsim.sensors.reading_checks import dead_readings
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor
from touchcal.arrays import Array, Mask
from touchcal.errors import InputFileError

_FROM_EDGE = 0.1  # part of the radius, of the disc of its area with an outline, that touches keep from the edge
_OTHER, _SAID, _MISFITS = 0.5, 0.05, 3.0  # changes of the untouched frame that are refused, and said
_DRAWS = 4  # of sensors that the calibration may have missed
_STEP = 1e-3  # of a standard deviation, over which signals are differenced
_RINGS = 12  # of pixels; one is as large as a touch's usual moment, 36 mm^2 of a disc of 100 mm


@dataclass(frozen=True, eq=False)
class ToIdeal:
    """The map from a calibrated sensor's readings to those of the sensor that its file describes."""

    untouched_V: Array  # (m,) of the ideal sensor, on the calibrated sheet
    matrix: Array  # (m, m) by which changes of the readings are multiplied
    left: float  # part of the ideal sensor's signals, over all places, that the map misses


def to_ideal(calibrated: CalibratedSensor, there: Mask | None = None) -> ToIdeal:
    """The map of a calibrated sensor; ValueError as `channel_changes`."""
    sensor, channels = calibrated.sensor, calibrated.instrument.channels(calibrated.state)
    even = Channels(conductance_S=channels.conductance_S)
    real, ideal = signals(calibrated, calibrated.state), ideal_signals(calibrated)
    there = np.ones(len(real), dtype=bool) if there is None else there
    matrix = least_squares_map(real, ideal, np.sqrt(2) * calibrated.misfit, there)
    rest = channel_readings(sensor.protocol, even, untouched_impedance(sensor.body, sensor.electrodes,
                                                                       channels.conductance_S[0])).ravel()
    return ToIdeal(rest, matrix, float(np.linalg.norm(ideal - matrix @ real) / np.linalg.norm(ideal)))


def signals(calibrated: CalibratedSensor, state: Array) -> Array:
    """(m, t) V what a relative change of conductance on each pixel makes of the readings of a state."""
    sensor, held = calibrated.sensor, calibrated.instrument
    return _signals(sensor, held.built(state), held.channels(state))


def ideal_signals(calibrated: CalibratedSensor) -> Array:
    """(m, t) V the same of the ideal sensor on the calibrated sheet."""
    sheet = calibrated.instrument.channels(calibrated.state).conductance_S
    return _signals(calibrated.sensor, calibrated.sensor.electrodes, Channels(conductance_S=sheet))


def _signals(sensor: Sensor, electrodes: Electrodes, channels: Channels) -> Array:
    mosaic = pixels_of(sensor.body, _RINGS)
    inside = from_edge_m(sensor.body, mosaic.centre_m) > _FROM_EDGE * sensor.body.edge.size_m
    return pixel_signals(sensor.body, electrodes, sensor.drive, channels, mosaic)[:, inside]


def least_squares_map(real: Array, ideal: Array, noise: float, there: Mask) -> Array:
    """(m, m) M that makes signals (m, t) of one sensor those of the other, one pixel at a time, noise their standard
    deviation, V."""
    real = real * there[:, None]
    gram = real @ real.T + real.shape[1] * noise**2 * np.eye(len(real))
    return np.diag(there.astype(float)) + np.linalg.solve(gram, real @ (ideal - real).T).T


def frame_noise(calibrated: CalibratedSensor, found: ToIdeal, seed: int = 0, change_V: float | None = None) -> float:
    """Standard deviation, V, of a corrected reading of a touched frame, r.m.s.: change_V, of touched less untouched
    frames through the map (`change_noise`; None: as if each frame scattered by the misfit of the calibration), and the
    map's error for a touch as large as a pixel, over sensors drawn by the standard deviations of the parameters.

    These are taken as independent, which makes the draws wider than the posterior, and the signals as linear in them:
    of a sensor far from the calibrated one, as by leaks that give back energy, no body is made.
    """
    chance, held, ideal = np.random.default_rng(seed), calibrated.instrument, ideal_signals(calibrated)
    middle = signals(calibrated, calibrated.state)
    error = float(np.mean(np.sum((ideal - found.matrix @ middle) ** 2, axis=0)))
    for _ in range(_DRAWS):
        step = _STEP * held.gauged(calibrated.sd * chance.standard_normal(held.size))
        change = found.matrix @ (signals(calibrated, calibrated.state + step) - middle) / _STEP
        error += float(np.mean(np.sum(change**2, axis=0))) / _DRAWS
    square = 2 * calibrated.misfit**2 * np.sum(found.matrix**2) / len(found.matrix) if change_V is None else change_V**2
    return float(np.sqrt(error / len(found.matrix) + square))


def live_readings(recording: Recording) -> Mask:
    """(m,) which readings are there in every frame and not dead."""
    return ~dead_readings(recording) & np.isfinite(recording.readings).all(axis=0)


def changed_since(calibrated: CalibratedSensor, recording: Recording, there: Mask) -> str:
    """In words, how far the median untouched frame of a recording is from that of the calibrated sensor; empty where it
    is the same to 5 % or three misfits of the calibration. InputFileError where they differ by half: then the map
    is that of another sensor, or the readings have another unit or order."""
    kept = there & np.isfinite(recording.readings).all(axis=0)
    if not recording.untouched.any() or not kept.any():
        return ""
    rest = np.median(np.real(recording.readings[recording.untouched]), axis=0)[kept]
    model = calibrated.readings().ravel()[kept]
    whole = float(np.linalg.norm(model))
    off, times = float(np.linalg.norm(rest - model)) / whole, float(rest @ model) / whole**2
    if off > _OTHER:
        raise InputFileError(recording.source, f"its untouched frame is {times:.3g} times that of the calibrated "
                             f"sensor and differs from it by {off:.0%}: other units (readings are in V), another order "
                             "or current, or another sensor. Correct the readings, or calibrate on this recording.")
    if off <= max(_SAID, _MISFITS * calibrated.misfit * np.sqrt(len(model)) / whole):
        return ""
    return (f"the untouched frame differs from the calibrated sensor's by {off:.0%} (it is {times:.3g} times as "
            "large): signals may be off by as much. Calibrate again on this recording.")


def ideal_frames(found: ToIdeal, calibrated: CalibratedSensor, recording: Recording) -> Recording:
    """A recording as the ideal sensor would read it: untouched frames are its own, touched ones the map of what they
    add to the untouched frame that came last before them, or first after; InputFileError where none is untouched.

    Of magnitudes the signs are those of the calibrated model, and what is given back is voltages.
    """
    rest = np.flatnonzero(recording.untouched)
    if not len(rest):
        raise InputFileError(recording.source, "no frame is untouched; leave `touch` empty in rows without a touch.")
    frames = np.real(recording.readings)
    sign = np.sign(calibrated.signed_readings().ravel()) if recording.kind == "magnitude" else 1.0
    there = live_readings(recording)
    latest = rest[np.maximum(np.searchsorted(rest, np.arange(len(frames)), side="right") - 1, 0)]
    change = np.where(recording.untouched[:, None], 0.0, np.where(there, sign * (frames - frames[latest]), 0.0))
    return replace(recording, readings=found.untouched_V + change @ found.matrix.T, kind="voltage")
