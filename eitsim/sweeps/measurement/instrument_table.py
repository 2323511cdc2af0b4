"""The measurement of a file: the keys of its `[measurement]` table, checked."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from eitsim.sweeps.measurement.instrument import BITS, CHANNELS, REFERENCES, Measurement
from touchcal.document import is_number
from touchcal.errors import InputFileError, unknown_key
from touchcal.toml_file import read_toml

TABLE = "measurement"
KEYS = tuple(field.name for field in fields(Measurement))
_WHOLE = {"seed": (0, None), "bits": (2, BITS), "frames": (1, 10_000), "baseline_frames": (1, 10_000)}
_SIZES = ("noise_V", "gain", "offset_V", "drift", "drift_channel", "drift_V", "drift_channel_V", "contact_impedance",
          "lsb_V")
_MOST_CONTACT = 0.2
# Rounding of a reading of some volts, and the most that an instrument reads, V; largest of relative changes.
_LEAST_V, _MOST_V, _MOST_CHANGE = 1e-15, 1e3, 10.0
_MOST_DB = 400.0


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
    if not isinstance(raw, Mapping):
        raise ValueError(f"[{TABLE}] must be a table of keys, got {raw!r}.")
    if unknown := [key for key in raw if key not in KEYS]:
        raise ValueError(unknown_key(unknown[0], KEYS, TABLE))
    for key, value in raw.items():
        _check_value(key, value)
    _check_noise(raw)
    _check_steps(raw)
    if raw.get("clean_baseline") and "baseline_frames" in raw:
        raise _wrong("baseline_frames", "has no effect with clean_baseline = true; leave one of them out")
    return Measurement(**raw)


def as_table(measurement: Measurement) -> dict[str, Any]:
    """The keys of `[measurement]` that differ from their defaults."""
    usual = asdict(Measurement())
    return {key: value for key, value in asdict(measurement).items() if value != usual[key]}


def _check_value(key: str, value: Any) -> None:
    if key in _WHOLE:
        least, most = _WHOLE[key]
        if not _is_number(value, int) or value < least or (most is not None and value > most):
            allowed = f"from {least}" if most is None else f"of {least} to {most}"
            raise _wrong(key, f"must be a whole number {allowed}, got {value!r}")
    elif key in _SIZES:
        if not _is_number(value) or value < 0:
            raise _wrong(key, f"must be a number from 0, got {value!r}")
        if key == "contact_impedance" and value > _MOST_CONTACT:
            raise _wrong(key, f"is counted to first order, which misses a tenth (lines) or a fifth (patches) of its "
                              f"effect at {_MOST_CONTACT}; got {value:g}, give that or less. What differs between "
                              "electrodes and stays belongs to [electrodes]")
        if key.endswith("_V") and value and not _LEAST_V <= value <= _MOST_V:
            raise _wrong(key, f"must be 0, for none, or from {_LEAST_V:g} V, which numbers resolve, to {_MOST_V:g} V, "
                              f"got {value:g}")
        if not key.endswith("_V") and value > _MOST_CHANGE:
            raise _wrong(key, f"must be at most {_MOST_CHANGE:g}, ten times the reading, got {value:g}")
    elif key == "full_scale_V":
        if not _is_number(value) or not _LEAST_V <= value <= _MOST_V:
            raise _wrong(key, f"must be a number from {_LEAST_V:g} to {_MOST_V:g} V, got {value!r}")
    elif key == "snr_db":
        if not _is_number(value) or abs(value) > _MOST_DB:
            raise _wrong(key, f"must be a number from {-_MOST_DB:g} to {_MOST_DB:g}, got {value!r}")
    elif key == "relative_to":
        if value not in REFERENCES and not (_is_number(value) and _LEAST_V <= value <= _MOST_V):
            raise _wrong(key, f"must be {' or '.join(map(repr, REFERENCES))} (of the untouched readings) or a voltage "
                              f"from {_LEAST_V:g} to {_MOST_V:g} V, got {value!r}")
    elif key == "clean_baseline":
        if not isinstance(value, bool):
            raise _wrong(key, f"must be true or false, got {value!r}")
    elif value not in CHANNELS:
        raise _wrong(key, f"'{value}' is unknown; known: {', '.join(CHANNELS)}")


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


def _is_number(value: Any, kind: Any = (int, float)) -> bool:
    return isinstance(value, kind) and is_number(value)


def _wrong(key: str, expected: str) -> ValueError:
    return ValueError(f"{key} in [{TABLE}] {expected}.")
