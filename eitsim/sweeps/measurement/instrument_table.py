"""The measurement of a file: the keys of its `[measurement]` table, checked."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from eitsim.sweeps.measurement.instrument import BITS, CHANNELS, REFERENCES, Measurement
from touchcal.document import Number, check, check_keys
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

TABLE = "measurement"
KEYS = tuple(field.name for field in fields(Measurement))
_MOST_CONTACT = 0.2
# Rounding of a reading of some volts, and the most that an instrument reads, V; largest of relative changes.
_LEAST_V, _MOST_V, _MOST_CHANGE = 1e-15, 1e3, 10.0
_VOLTAGE = Number(_LEAST_V, _MOST_V)
_SHAPES = {"seed": Number(0, whole=True), "bits": Number(2, BITS, whole=True),
           **dict.fromkeys(("frames", "baseline_frames"), Number(1, 10_000, whole=True)),
           **dict.fromkeys(("noise_V", "offset_V", "drift_V", "drift_channel_V", "lsb_V"), Number(0, _MOST_V)),
           **dict.fromkeys(("gain", "drift", "drift_channel"), Number(0, _MOST_CHANGE)),
           "contact_impedance": Number(0), "full_scale_V": _VOLTAGE, "snr_db": Number(-400, 400),
           "clean_baseline": bool, "relative_to": (_VOLTAGE, str), "channels": str}


def read_measurement(path: Path | str) -> Measurement:
    """The `[measurement]` of a TOML file of its own; InputFileError names the file and the key."""
    path = Path(path)
    raw = read_toml(path)
    try:
        if set(raw) != {TABLE}:
            raise ValueError(f"it must hold one table [{TABLE}] and nothing else, got "
                             f"{', '.join(raw) or 'nothing'}.")
        return measurement_from(raw[TABLE])
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def measurement_from(raw: Any) -> Measurement:
    """A checked measurement of the keys of `[measurement]`; ValueError names the key and what it may hold."""
    check_keys(raw, KEYS, TABLE)
    for key, value in raw.items():
        _check_value(key, value)
    _check_noise(raw)
    _check_steps(raw)
    if raw.get("clean_baseline") and "baseline_frames" in raw:
        raise _wrong("baseline_frames", "has no effect with clean_baseline = true; leave one of them out")
    whole = {key: int(value) for key, value in raw.items() if getattr(_SHAPES[key], "whole", False)}
    return Measurement(**{**raw, **whole})


def as_table(measurement: Measurement) -> dict[str, Any]:
    """The keys of `[measurement]` that differ from their defaults."""
    usual = asdict(Measurement())
    return {key: value for key, value in asdict(measurement).items() if value != usual[key]}


def _check_value(key: str, value: Any) -> None:
    check(value, _SHAPES[key], f"{key} in [{TABLE}]")
    if key == "contact_impedance" and value > _MOST_CONTACT:
        raise _wrong(key, f"is counted to first order, which misses a tenth (lines) or a fifth (patches) of its effect "
                          f"at {_MOST_CONTACT}; got {value:g}, give that or less. What differs between electrodes and "
                          "stays belongs to [electrodes]")
    if key.endswith("_V") and 0 < value < _LEAST_V:
        raise _wrong(key, f"must be 0, for none, or from {_LEAST_V:g} V, which numbers resolve, got {value:g}")
    known = {"relative_to": REFERENCES, "channels": CHANNELS}.get(key, ())
    if isinstance(value, str) and value not in known:
        raise _wrong(key, f"'{value}' is unknown; known: {', '.join(known)}")


def _check_noise(raw: Mapping[str, Any]) -> None:
    if "snr_db" not in raw:
        if "relative_to" in raw:
            raise _wrong("relative_to", "has no effect without snr_db; give snr_db, or leave it out")
        return
    if raw.get("noise_V"):
        raise _wrong("noise_V", "says what snr_db says too; give one of them")
    if "relative_to" not in raw:
        raise _wrong("snr_db", "says nothing until relative_to names the voltage that it refers to: 'largest' or 'rms' "
                               "of the untouched readings, or a number of V")


def _check_steps(raw: Mapping[str, Any]) -> None:
    if ("bits" in raw) != ("full_scale_V" in raw):
        missing = "bits" if "full_scale_V" in raw else "full_scale_V"
        raise _wrong(missing, "is missing: a quantisation has bits and full_scale_V, or lsb_V alone")
    if "bits" in raw and raw.get("lsb_V"):
        raise _wrong("lsb_V", "follows from bits and full_scale_V; give either it or these two")


def _wrong(key: str, expected: str) -> ValueError:
    return ValueError(f"{key} in [{TABLE}] {expected}.")
