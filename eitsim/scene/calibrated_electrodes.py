"""The electrodes and channels of a calibrated sensor in the place of a scene's: `calibrated` in [electrodes].

    [electrodes]
    calibrated = "sensor.json"

Where labelled presses fitted a skin, its card serves a file that names none, and how far signals of presses that were
left out scatter in size counts as an error of all signals. A file that names another card counts what the presses were
missed by before the fit, since the smaller error is that of the fitted card.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.fitted_layer import fitted_table
from touchcal.arrays import Array
from touchcal.document import Keys, Number
from touchcal.errors import InputFileError
from touchcal.json_file import read_json

# Group of parameters -> what its names begin with as `eitsim sensor fit` writes them, with the unit of the value
NAMES = {"conductance": "ln_conductance_S", "contacts": "ln_contact_impedance_Ohm_m", "width": "ln_width_factor",
         "positions": "offset_mm", "gains": "gain", "currents": "current_factor", "leaks": "leak_uS",
         "sheet": "sheet_mode", "widths": "ln_one_width_factor"}
SCHEMA = 2
_FIX = "A calibrated sensor is the JSON that `eitsim sensor fit` writes."
_LENGTHS = (Number(), [Number()])
_BODY = Keys({}, {"radius_mm": Number(1e-3), "outline": str})
_SENSOR = Keys({"body": _BODY, "skin": dict, "drive": dict, "electrodes": Keys({
    "kind": str, "count": Number(4, 64, whole=True), "width_mm": _LENGTHS}, {
    "first_angle_deg": Number(), "clockwise": bool, "angles_deg": [Number()], "positions_mm": [Number()],
    "soft": bool})})
_SKIN = Keys({"card": (str, None), "size_error": Number(0, 10)}, {
    "of_card": dict, "count": Number(1, whole=True), "left_out": [str], "too_deep": [str], "odd": [str], "kept": [str],
    "centre_mm": [Number()], "turn_deg": Number(), "mirrored": bool, "unexplained": {str: Number(0)},
    "pattern_error": Number(0), "pattern_V": Number(0), "covariance": [[Number()]]})
_SHAPE = Keys({"schema": Number(1, whole=True), "sensor": _SENSOR, "absolute_model": str, "reason": str,
               "misfit": (Number(0), None),
               "parameters": {str: Keys({"value": Number(-1e6, 1e6), "sd": Number(0), "prior_sd": Number(0)})}}, {
    "skin": (_SKIN, None)})


def with_calibrated(tables: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene or design file with the calibrated sensor of [electrodes] in its place, its name relative
    to `folder`; InputFileError names the file, ValueError the key."""
    electrodes = tables.get("electrodes")
    if not isinstance(electrodes, Mapping) or "calibrated" not in electrodes:
        return dict(tables)
    if other := [f"{key} in [electrodes]" for key in electrodes if key != "calibrated"] + (
            ["[channels]"] if "channels" in tables else []):
        raise ValueError(f"{other[0]} has no effect with calibrated in [electrodes]; leave it out.")
    name = electrodes["calibrated"]
    if not isinstance(name, str):
        raise ValueError(f"calibrated in [electrodes] must be the name of a file, got {name!r:.80}.")
    other = tables.get("card")
    own = calibrated_tables(folder / name, folder / other if isinstance(other, str) else None)
    body = tables.get("body")
    for key, value in body.items() if isinstance(body, Mapping) else ():
        if key != "thickness_mm" and value != (known := own["body"].get(key)):
            own_value = f", {known!r:.80}" if known is not None else ", which has none"
            raise ValueError(f"{key} in [body] must be that of the calibrated sensor{own_value}, got {value!r:.80}; "
                             "leave it out.")
    if (card := own.pop("card", None)) is not None:
        own["card"] = (Path(name).parent / card).as_posix()
    return {**own, **tables, **{key: own[key] for key in ("electrodes", "channels")},
            **({"body": {**own["body"], **body}} if isinstance(body, Mapping) else {})}


def read_fitted(path: Path) -> dict[str, Any]:
    """The document of `eitsim sensor fit`; InputFileError where it is none, or of another schema."""
    raw = read_json(path, "a calibrated sensor", _FIX, _SHAPE)
    if raw["schema"] != SCHEMA:
        raise InputFileError(path, f"schema {raw['schema']} is not {SCHEMA}, which is read here. Fit the sensor again.")
    body = raw["sensor"]["body"]
    if body.get("outline", "disc") == "disc" and "radius_mm" not in body:
        raise InputFileError(path, f"the key 'radius_mm' is missing in sensor.body. {_FIX}")
    return raw


def same_card(one: Path, other: Path) -> bool:
    """Whether two paths lead to one card, or to copies of it."""
    return one.resolve() == other.resolve() or (
        one.is_file() and other.is_file() and one.read_bytes() == other.read_bytes())


def calibrated_tables(path: Path, card: Path | None = None) -> dict[str, Any]:
    """[body], [skin], [electrodes], [drive] and [channels] of a calibrated sensor's file, and the name of its skin's
    card, relative to it, where there is one; InputFileError where its absolute model was refused, or a parameter is
    missing. card: another one that serves in its place."""
    raw = read_fitted(path)
    if raw["absolute_model"] != "usable":
        raise InputFileError(path, f"its absolute model was refused: {raw['reason']} Give a scene the [electrodes] of "
                                   "the sensor file.")
    sensor, values = raw["sensor"], {name: one["value"] for name, one in raw["parameters"].items()}
    try:
        electrodes, channels = _electrodes(sensor, values), _channels(sensor["electrodes"]["count"], values)
    except ValueError as error:
        raise InputFileError(path, str(error)) from None
    skin = raw.get("skin") or {}
    if skin:
        fitted = card is None or same_card(card, path.parent / (skin["card"] or ""))
        channels["size_error"] = [skin["size_error"] if fitted else
                                  max(skin["size_error"], skin.get("unexplained", {}).get("card", 0.0))]
    return {"body": sensor["body"], "skin": fitted_table(sensor["skin"], values), "drive": sensor["drive"],
            "electrodes": electrodes, "channels": channels, **({"card": skin["card"]} if skin.get("card") else {})}


def _electrodes(sensor: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    """[electrodes] as calibrated: even angles stay so where no electrode is displaced."""
    design = sensor["electrodes"]
    count, first, angles = design["count"], design.get("first_angle_deg", 0.0), design.get("angles_deg", [])
    offset, clockwise = _each("positions", count, values), design.get("clockwise", False)
    if sensor["body"].get("outline", "disc") != "disc":
        if len(along := design.get("positions_mm", [])) != count:
            raise ValueError(f"positions_mm in sensor.electrodes must hold {count} numbers, got {len(along)}. {_FIX}")
        place = {"first_angle_deg": first, "positions_mm": (np.array(along) + offset).tolist()}
    elif angles or offset.any():
        even = angles or first + (-360 if clockwise else 360) / count * np.arange(count)
        place = {"angles_deg": (even + np.degrees(offset / sensor["body"]["radius_mm"])).tolist()}
    else:
        place = {"first_angle_deg": first, "clockwise": clockwise}
    width = np.broadcast_to(design["width_mm"], count) * np.exp(_one("width", values) + _each("widths", count, values))
    contact = np.exp(_each("contacts", count, values))
    return {"kind": design["kind"], "count": count, **place, "width_mm": width.tolist(),
            "contact_impedance_Ohm_m": contact.tolist(), "soft": design.get("soft", False)}


def _channels(count: int, values: Mapping[str, float]) -> dict[str, list[float]]:
    return {"gains": _each("gains", count, values).tolist(),
            "current_factors": [values.get(f"{NAMES['currents']}_{k:02d}", 1.0) for k in range(count)],
            "leaks_uS": _each("leaks", count, values).tolist(),
            "conductance_S": [float(np.exp(_one("conductance", values)))],
            "sheet_modes": [one for name, one in values.items() if name.startswith(NAMES["sheet"])]}


def _one(group: str, values: Mapping[str, float]) -> float:
    return _found(NAMES[group], values)


def _each(group: str, count: int, values: Mapping[str, float]) -> Array:
    return np.array([_found(f"{NAMES[group]}_{k:02d}", values) for k in range(count)])


def _found(name: str, values: Mapping[str, float]) -> float:
    if name not in values:
        raise ValueError(f"'{name}' in parameters is missing. Fit the sensor again.")
    return values[name]
