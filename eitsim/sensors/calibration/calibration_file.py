"""A calibration as JSON, and the calibrated sensor that is read back from it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.calibrated_electrodes import SCHEMA, read_fitted
from eitsim.scene.drive import Drive, Protocol, as_tuples, matrix_rows, protocol
from eitsim.scene.fitted_layer import ACROSS, PIEZO, THICKNESS
from eitsim.scene.scene import scene_tables
from eitsim.sensors.calibration.calibrate import Calibration, FittedSkin, check_electrodes, untouched_readings
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, sources
from eitsim.sensors.calibration.labelled_presses import GAIN_SD, MOMENT_SD
from eitsim.sensors.calibration.placement import Placement
from eitsim.sensors.calibration.skin_law import PRIORS, fitted_skin
from eitsim.sensors.sensor_file import TABLES, Sensor, read_sensor, sensor_from
from matcal.card import card_identity
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.input_file import regular

NOT_DETERMINED = 0.9  # posterior over prior standard deviation from which the data say nothing of a parameter
_MOMENT = "ln_moment_mm2"
# What names of parameters that presses gave begin with
_OF_PRESSES = (_MOMENT, "reading_gain", THICKNESS, PIEZO, ACROSS,
                *(name for sds in PRIORS.values() for name in sds))


@dataclass(frozen=True, eq=False)
class CalibratedSensor:
    """A sensor and the state of its instrument."""

    sensor: Sensor
    instrument: Instrument
    state: Array  # (p,) in the order of instrument.names, in its units
    misfit: float  # standard deviation of an untouched reading about the model, V
    sd: Array  # (p,) standard deviations of the state

    def readings(self, asked: Protocol | None = None) -> Array:
        """Untouched readings (patterns, readings) of a protocol, else of its own; ValueError where a pattern has
        several sinks."""
        return untouched_readings(self.instrument, self.state, asked or self.sensor.protocol, self.sensor.kind)

    def signed_readings(self) -> Array:
        """Untouched readings (patterns, readings) of its own protocol with their signs, V."""
        return untouched_readings(self.instrument, self.state, self.sensor.protocol, "voltage")


def calibration_document(found: Calibration, skin_card: str | None = None) -> dict[str, Any]:
    """What `eitsim sensor fit` writes: values with their standard deviations before and after, by name; skin_card: name
    of the file, next to this one, that holds the card of the skin.

    >>> import eitsim, numpy as np
    >>> sensor = eitsim.Sensor(eitsim.Body(), eitsim.Skin(), eitsim.Electrodes(), eitsim.Drive(), "difference")
    >>> touched = eitsim.Recording(np.ones((1, 208)), np.array([0]), None, np.array(["a"]), "difference", "frames.csv")
    >>> eitsim.calibration_document(eitsim.calibrate(sensor, touched))["kind"]
    'changes only'
    """
    parameters = parameters_of(found)
    size = found.size
    return {"schema": SCHEMA, "kind": "changes only" if found.reason else "absolute",
            "sensor": _sensor_tables(found.sensor),
            "absolute_model": "refused" if found.reason else "usable", "reason": found.reason,
            "untouched_frames": found.frames, "tests": asdict(found.tests) if found.tests is not None else None,
            "stage": found.kept[-1] if found.kept else None, "kept": list(found.kept),
            "unexplained": {group: {"fitted": one.fitted, "held_out": one.held_out}
                            for group, one in found.stages.items()},
            "misfit": found.fit.misfit if found.fit is not None else None, "parameters": parameters,
            "not_determined": [name for name, one in parameters.items()
                               if one["sd"] >= NOT_DETERMINED * one["prior_sd"]],
            "unexplained_by_electrode": list(found.by_electrode), "dead_readings": list(found.dead),
            "left_out": {str(electrode): why for electrode, why in found.left_out.items()},
            "presses": None if size is None else {
                "count": size.presses, "sign": size.sign, **_placed(size.lies),
                "gains_kept": size.gains_kept,
                "unexplained": {"size": {"fitted": size.fitted, "held_out": size.held_out},
                                "gains": {"fitted": size.fitted_gains, "held_out": size.held_out_gains}}},
            "layer": layer_of(found),
            "skin": None if found.skin is None else _skin_block(found.skin, skin_card)}


def layer_of(found: Calibration) -> dict[str, Any] | None:
    """Conductivity, S/m, and contact impedances (N,), Ohm m^2, of a layer that conducts in its volume, with relative
    standard deviations: S/t and z t of the sheet that was fitted, t as the sensor file says, or as labelled presses do.
    No untouched reading of electrodes over its whole height tells a thicker layer from a more conductive one. None of
    other skins, and where nothing was fitted."""
    if not found.sensor.skin.fills or found.instrument is None or found.fit is None:
        return None
    thickness, thickness_sd, (state, places) = found.sensor.skin.thickness_m, 0.0, (
        found.fit.state, found.instrument.places)
    if found.skin is not None:
        fit = found.skin.fit
        thickness = fitted_skin(found.sensor.skin, fit.values).thickness_m
        thickness_sd = float(np.sqrt(np.diag(fit.covariance)[fit.names.index(THICKNESS)]))
    sd = np.hypot(found.instrument.units * np.sqrt(np.diag(found.fit.covariance)), thickness_sd)
    sheet, contacts = places["conductance"], places["contacts"]
    return {"thickness_mm": 1e3 * thickness, "conductivity_S_per_m": float(np.exp(state[sheet][0])) / thickness,
            "conductivity_sd": float(sd[sheet][0]),
            "contact_impedance_Ohm_m2": (np.exp(state[contacts]) * thickness).tolist(),
            "contact_impedance_sd": sd[contacts].tolist()}


def _placed(lies: Placement) -> dict[str, Any]:
    return {"centre_mm": [1e3 * one for one in lies.centre_m], "turn_deg": float(np.degrees(lies.turn_rad)),
            "mirrored": lies.mirrored}


def _skin_block(skin: FittedSkin, card: str | None) -> dict[str, Any]:
    fit = skin.fit
    return {"card": card, "of_card": card_identity(skin.card), "count": skin.presses, "left_out": list(skin.left_out),
            "too_deep": list(skin.too_deep), "odd": list(skin.odd), **_placed(skin.lies),
            "kept": list(fit.kept), "unexplained": {"card": fit.before, **fit.left, "kept": fit.after},
            "size_error": fit.size_error, "pattern_error": fit.pattern_error, "pattern_V": fit.pattern_V,
            "covariance": fit.covariance.tolist()}


def parameters_of(found: Calibration) -> dict[str, dict[str, float]]:
    """Name of a parameter -> its value, posterior and prior standard deviation, the prior's where its group is held;
    last what labelled presses gave."""
    out: dict[str, dict[str, float]] = {}
    if found.instrument is not None and found.fit is not None:
        held = found.instrument
        root = held.gauged(np.diag(held.prior_sd))
        spreads = (held.units * np.sqrt(variance) for variance in (np.diag(found.fit.covariance),
                                                                  np.sum(root**2, axis=0)))
        out = {name: {"value": float(value), "sd": float(sd), "prior_sd": float(prior)}
               for name, value, sd, prior in zip(held.names, held.units * found.fit.state, *spreads, strict=True)}
    if (size := found.size) is not None:
        value, sd = size.ln_moment
        out[_MOMENT] = {"value": value, "sd": sd, "prior_sd": MOMENT_SD}
        if found.reason:
            out |= {f"reading_gain_{k:03d}": {"value": float(gain), "sd": float(sd), "prior_sd": GAIN_SD}
                    for k, (gain, sd) in enumerate(zip(size.gain, size.gain_sd, strict=True))}
    if found.skin is not None:
        fit = found.skin.fit
        out |= {name: {"value": float(value), "sd": float(sd), "prior_sd": float(prior)} for name, value, sd, prior in
                zip(fit.names, fit.value, np.sqrt(np.diag(fit.covariance)), fit.prior_sd, strict=True)}
    return out


def read_calibration(path: Path | str) -> CalibratedSensor:
    """Read what `calibration_document` made; InputFileError names the file and what is wrong: another schema, a refused
    model, parameters that are not the sensor's, or electrodes that overlap.

    >>> import eitsim
    >>> eitsim.read_calibration("absent.json")
    Traceback (most recent call last):
    touchcal.errors.InputFileError: absent.json: no such file. Check the name and the folder.
    """
    path = Path(path)
    raw = read_fitted(path)
    if raw["absolute_model"] != "usable":
        raise InputFileError(path, f"its absolute model was refused: {raw['reason']}")
    try:
        sensor = sensor_from(raw["sensor"], path.parent)
        check_electrodes(sensor)
        return _with_state(sensor, {name: one for name, one in raw["parameters"].items()
                                    if not name.startswith(_OF_PRESSES)}, raw["misfit"])
    except InputFileError:
        raise
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def read_described_sensor(path: Path | str) -> tuple[Sensor, str]:
    """The sensor that a file describes, and which file it is: "sensor file" (TOML), or "calibrated sensor", the JSON
    that `eitsim sensor fit` writes, whose body, electrodes, drive and readings are taken even where its absolute model
    was refused. InputFileError as `read_sensor` and `read_calibration`."""
    path = Path(path)
    if not _is_json(path):
        return read_sensor(path), "sensor file"
    raw = read_fitted(path)
    try:
        return sensor_from(raw["sensor"], path.parent), "calibrated sensor"
    except InputFileError:
        raise
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def protocol_of_files(sensor: Sensor, currents: Path, measurements: Path) -> Protocol:
    """The protocol of two CSV files as [drive] names them, currents in units of the sensor's; InputFileError names a
    file that cannot be read, ValueError what does not fit the sensor."""
    tables = {"currents": matrix_rows(currents), "measurements": matrix_rows(measurements)}
    drive = Drive(sensor.drive.current_A, **{key: as_tuples(rows) for key, rows in tables.items()})
    return protocol(drive, sensor.electrodes.count)


def _is_json(path: Path) -> bool:
    """Whether a file begins as a JSON object; no TOML does."""
    with open(regular(path), "rb") as file:
        return file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"{")


def _with_state(sensor: Sensor, parameters: Mapping[str, Mapping[str, float]], misfit: float) -> CalibratedSensor:
    name = GROUPS["conductance"].name
    conductance = float(np.exp(parameters[name]["value"])) if name in parameters else np.nan
    instrument = Instrument(sensor.body, sensor.electrodes, sources(sensor.protocol), conductance)
    if odd := set(instrument.names).symmetric_difference(parameters):
        state = "no parameter of this sensor" if min(odd) in parameters else "missing"
        raise ValueError(f"'{min(odd)}' in parameters is {state}. Fit the sensor again.")
    state = np.array([parameters[one]["value"] for one in instrument.names]) / instrument.units
    sd = np.array([parameters[one]["sd"] for one in instrument.names]) / instrument.units
    calibrated = CalibratedSensor(sensor, instrument.around(state), state, misfit, sd)
    calibrated.readings()
    return calibrated


def _sensor_tables(sensor: Sensor) -> dict[str, Any]:
    # offsets of single electrodes are added to these
    tables = scene_tables(replace(sensor.scene, electrodes=sensor.body.edge.by_arc(sensor.electrodes)))
    return {name: tables[name] for name in TABLES if name in tables} | {"readings": {"kind": sensor.kind}}
