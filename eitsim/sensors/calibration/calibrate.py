"""Calibrate the absolute model of a sensor to its untouched frame, or refuse it with the reason."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from eitsim.scene.drive import Protocol
from eitsim.sensors.calibration.instrument_model import Instrument, sinks, sources, voltages
from eitsim.sensors.calibration.ohm_tests import OhmTests, ohm_tests
from eitsim.sensors.calibration.stages import Fit, Stage, Untouched, driven, fit_best, random_starts, staged
from eitsim.sensors.reading_checks import mean_frame
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor
from touchcal.arrays import Array

# Readings that an ohmmeter makes the same and that differ by as much as they are have nothing in common; more than
# this part of the readings off the driven electrodes, unexplained on drives not fitted, and the model is of no use.
MOST_APART, MOST_UNEXPLAINED = 1.0, 0.1
_FIRST_CONDUCTANCE = 1e-3  # S, from which the readings' size gives the one that the fit starts at
_DIFFERENCES = ("the readings are differences to an untouched frame that is not here; record voltages or magnitudes to "
                "calibrate the absolute model.")
_WORDS = {"repeats": "readings of the same drive differ",
          "source_against_sink": "readings with source and sink exchanged differ",
          "reciprocity": "readings with drive and measurement exchanged differ",
          "superposition": "readings differ from what is linear in the currents"}


@dataclass(frozen=True, eq=False)
class Calibration:
    """What the untouched readings of a sensor gave."""

    sensor: Sensor
    frames: int  # untouched frames, whose mean is fitted
    tests: OhmTests | None  # None of differences
    reason: str = ""  # why the absolute model is refused; empty where it is usable
    stages: Mapping[str, Stage] = field(default_factory=dict)  # by group of parameters, on half of the drives
    kept: tuple[str, ...] = ()  # groups that are fitted, in the order in which they were freed
    instrument: Instrument | None = None  # None where nothing was fitted
    fit: Fit | None = None  # of all drives


def calibrate(sensor: Sensor, recording: Recording, *, seed: int = 0) -> Calibration:
    """Fit conductance, contacts, width, places, gains, currents and leaks of a sensor to the mean of its untouched
    frames, stage by stage, the most probable state under Gaussian priors.

    A stage is left out where drives that were not fitted, a random half by `seed`, are clearly worse predicted by it;
    the last fit takes all drives. Priors stand in `instrument_model.GROUPS`. Readings may be volts or the counts of a
    board; then conductances are by the same unknown factor. Refused, with the reason and no state: differences, which
    have no untouched frame, and readings that are no ohmmeter's (`ohm_tests`). Refused with its state: a model that
    leaves more than MOST_UNEXPLAINED.

    ValueError where the sensor has electrodes that are no lines or have no contact, several sinks at once, fewer than
    two drives, no reading off the driven electrodes, or the recording no untouched frame.

    >>> import eitsim, numpy as np
    >>> sensor = eitsim.Sensor(eitsim.Body(), eitsim.Skin(), eitsim.Electrodes(), eitsim.Drive(), "difference")
    >>> touched = eitsim.Recording(np.ones((1, 208)), np.array([0]), None, np.array(["a"]), "difference", "frames.csv")
    >>> eitsim.calibrate(sensor, touched).reason
    'the readings are differences to an untouched frame that is not here; ...'
    """
    if sensor.kind == "difference":
        return Calibration(sensor, 0, None, _DIFFERENCES)
    frame = untouched(sensor, recording)
    tests = ohm_tests(sensor, frame.volts)
    count = int(recording.untouched.sum())
    if reason := no_ohmmeter(tests):
        return Calibration(sensor, count, tests, reason)
    instrument = Instrument(sensor.body, sensor.electrodes, sources(frame.asked), _FIRST_CONDUCTANCE)
    instrument = _of_size(instrument, frame)
    stages, kept, half = staged(instrument, frame, seed)
    found = fit_best(instrument, frame, kept, random_starts(instrument, kept, half.state, seed))
    left = stages[kept[-1]].held_out
    reason = "" if left <= MOST_UNEXPLAINED else (
        f"{left:.0%} of the readings off the driven electrodes stay unexplained on drives that were not fitted, and "
        f"{MOST_UNEXPLAINED:.0%} are the most; only changes of readings can be used.")
    return Calibration(sensor, count, tests, reason, stages, kept, instrument, found)


def untouched(sensor: Sensor, recording: Recording) -> Untouched:
    """The mean of a recording's untouched frames, of complex readings the real part; ValueError as `calibrate`."""
    check_electrodes(sensor)
    if recording.kind != sensor.kind:
        raise ValueError(f"{recording.source}: its readings are of kind '{recording.kind}', and kind in [readings] of "
                         f"the sensor is '{sensor.kind}'; correct one of them.")
    asked = sensor.protocol
    sinks(asked)
    rows = np.real(recording.readings[recording.untouched])
    if not len(rows):
        raise ValueError(f"{recording.source}: no frame is untouched; leave `touch` empty in rows without a touch.")
    frame = Untouched(asked, mean_frame(rows).reshape(asked.shape), sensor.kind == "voltage")
    if len(np.unique(driven(asked), axis=0)) < 2:
        raise ValueError("[drive] has one drive alone, and a calibration is judged on drives that were not fitted.")
    if not frame.volts[frame.off_driven].any():
        raise ValueError("no reading uses electrodes without current alone, and a calibration is judged by those.")
    return frame


def check_electrodes(sensor: Sensor) -> None:
    """ValueError where the instrument model is not built for a sensor's body or electrodes."""
    if sensor.body.has_outline:
        raise ValueError("the instrument model is built for discs, not for skins with an outline in [body].")
    if sensor.electrodes.kind != "line" or sensor.electrodes.missing:
        raise ValueError("the instrument model is built for line electrodes which all have contact; leave kind and "
                         "missing out of [electrodes], and drives and readings of dead electrodes out of [drive].")


def no_ohmmeter(tests: OhmTests) -> str:
    """Why readings are not those of an ohmmeter; empty where no test says so."""
    values = {one.name: getattr(tests, one.name) for one in fields(tests)}
    apart = {name: value for name, value in values.items() if value is not None and value >= MOST_APART}
    return "" if not apart else "the instrument is no ohmmeter: " + ", ".join(
        f"{_WORDS[name]} by {value:.0%} of their norm" for name, value in apart.items()) + (
        "; only changes of readings can be used.")


def untouched_readings(instrument: Instrument, state: Array, asked: Protocol, kind: str) -> Array:
    """Readings (patterns, readings) of a calibrated sensor by a protocol, V; sizes alone of magnitudes."""
    model = voltages(instrument, asked, state)
    return np.abs(model) if kind == "magnitude" else model


def _of_size(instrument: Instrument, frame: Untouched) -> Instrument:
    """The instrument with the conductance at which the model's readings have the size of the frame's."""
    where = frame.off_driven
    size = np.linalg.norm(voltages(instrument, frame.asked, instrument.prior_mean)[where])
    conductance = instrument.start_conductance_S * float(size / np.linalg.norm(frame.volts[where]))
    return Instrument(instrument.body, instrument.electrodes, instrument.sources, conductance)
