"""Scenes from files and tables and back, and lengths of a body that a punch stands on."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.channels import Channels
from eitsim.scene.drive import MATRICES, MOST_WEIGHT, Drive
from eitsim.scene.electrodes import IMPEDANCES, Electrodes
from eitsim.scene.electrodes import KINDS as ELECTRODE_KINDS
from eitsim.scene.profiles.profile import Profile
from eitsim.scene.profiles.registry import profiles
from eitsim.scene.scene_files import with_files
from eitsim.scene.scene_keys import (
    CLASSES,
    EACH,
    IN_FILES,
    KEYS,
    LISTS,
    MOST_TOUCHES,
    check,
    one_of,
    parts_of,
    value_of,
)
from eitsim.scene.scene_parts import STRAINS, Accuracy, Body, Hold, Punch, Scene, Skin
from touchcal.arrays import Array
from touchcal.errors import InputFileError, unknown_key
from touchcal.toml_file import read_toml

__all__ = ["STRAINS", "Accuracy", "Body", "Channels", "Drive", "Electrodes", "Hold", "Punch", "Scene", "Skin",
           "as_scene", "from_edge_m", "profile_of", "read_scene", "rim_gap_m", "scene_from", "scene_keys",
           "scene_tables"]


def profile_of(punch: Punch, unit_m: float = 1.0) -> Profile:
    """The punch's profile, lengths over a unit; ValueError for a profile that is not known."""
    one_of("profile in [punch]", punch.profile, profiles())
    return profiles()[punch.profile].of(punch.diameter_m / 2 / unit_m, punch.fillet_m / unit_m, punch.half_angle_rad)


def rim_gap_m(body: Body, punch: Punch) -> float:
    """Distance from the punch's edge to the rim, or to the nearest edge or hole of an outline, m; negative where it
    overhangs."""
    return float(from_edge_m(body, np.array([punch.x_m, punch.y_m]))) - punch.diameter_m / 2


def from_edge_m(body: Body, points_m: Array) -> Array:
    """Distance (...) of points (..., 2) to the rim, or to the nearest edge or hole of an outline, m; negative
    outside."""
    return body.edge.gap_m(points_m)


def scene_keys() -> dict[str, tuple[str, ...]]:
    """Table -> keys that a scene file may hold."""
    return {table: tuple(keys) for table, keys in KEYS.items()}


def scene_tables(scene: Scene) -> dict[str, Any]:
    """The scene as the tables of a scene file, every default that has an effect filled in, units as the keys say."""
    out: dict[str, Any] = {}
    for table, keys in KEYS.items():
        parts = parts_of(scene, table)
        blocks = [{key: _unconverted(getattr(part, name), per) for key, (name, per) in keys.items()
                   if getattr(part, name) is not None} for part in parts]
        out[table] = blocks if table == "punch" else blocks[0]
    out["channels"] = {key: values for key, values in out["channels"].items() if values}
    if not out["channels"]:
        del out["channels"]
    _without_idle(scene, out)
    drive = scene.drive
    for key, instead in (("pattern", drive.currents), ("reading", drive.currents or drive.measurements)):
        if instead is not None:
            del out["drive"][key]
    return out




def _without_idle(scene: Scene, tables: dict[str, Any]) -> None:
    """Take out of a scene's tables what outlines alone have, or what they leave without effect, and the lean of upright
    punches."""
    for punch, table in zip(scene.punches, tables["punch"], strict=True):
        if punch.tilt_rad == 0:
            del table["tilt_deg"], table["tilt_direction_deg"]
    outlined = not scene.body.edge.is_round
    kept = ("clockwise", *IMPEDANCES, *(() if outlined else ("length_mm",)))
    idle = [key for key in ELECTRODE_KINDS[scene.electrodes.kind].idle if key not in kept]
    empty = {"body": LISTS["body"], "electrodes": ("positions_mm", "shares", "x_mm", "y_mm") + (
        ("angles_deg",) if outlined else ())}
    for table, keys in empty.items():
        for key in (*(idle if table == "electrodes" else ()), *(key for key in keys if tables[table].get(key) == [])):
            tables[table].pop(key, None)


def _unconverted(value: Any, per: float | None) -> Any:
    if isinstance(value, tuple):
        return [_unconverted(part, per) for part in value]
    if per is None:
        return value
    return value if per == 1.0 else float(f"{value * per:.12g}")


def read_scene(path: Path | str) -> Scene:
    """Read a scene file (TOML); InputFileError names the file and the key, ValueError's text inside it."""
    path = Path(path)
    raw = read_toml(path)
    if "scenes" in raw:
        raise InputFileError(path, "scenes makes it a design, which `eitsim sweep` takes. Give a file of one scene, "
                                   "without ranges.")
    if "readings" in raw:
        raise InputFileError(path, "[readings] makes it a sensor file, which `eitsim sensor` and `eitsim reconstruct` "
                                   "take; in Python eitsim.read_sensor(path).scene is its scene.")
    if isinstance(raw.get("body"), Mapping) and "surface" in raw["body"]:
        raise InputFileError(path, "surface in [body] makes it a scene on a curved body, which `eitsim run` and "
                                   "`eitsim plan` take; here flat skins alone are taken.")
    try:
        return scene_from(with_files(raw, path.parent))
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def as_scene(scene: Scene | Path | str) -> Scene:
    """A scene made in Python, checked, or the one that a file (TOML) holds; errors as those of `read_scene`."""
    if not isinstance(scene, Scene):
        return read_scene(scene)
    if not scene.punches:
        raise ValueError("punches is empty; give one Punch a touch.")
    check(scene)
    return scene


def scene_from(raw: Mapping[str, Any]) -> Scene:
    """A checked scene from the tables of a scene file, units as their keys say; ValueError names the key."""
    known = (*KEYS, "card")
    if unknown := [key for key in raw if key not in known]:
        raise ValueError(unknown_key(unknown[0], known))
    parts: dict[str, Any] = {}
    for table in KEYS:
        if table in raw and table != "punch":
            parts[table] = _electrodes(raw[table]) if table == "electrodes" else _table(table, raw[table])
    if "body" in parts:
        parts["body"] = parts["body"].body()
    touches = raw.get("punch", {})
    touches = touches if isinstance(touches, list) else [touches]
    if len(touches) > MOST_TOUCHES:
        raise ValueError(f"punch holds {len(touches)} touches; at most {MOST_TOUCHES} are solved.")
    if not touches:
        raise ValueError("punch is an empty list; give one [[punch]] a touch, or leave it out for the default one.")
    parts["punches"] = tuple(_table("punch", t) for t in touches)
    if not isinstance(raw.get("card", ""), str):
        raise ValueError(f"card must be the name of a file, got {raw['card']!r:.80}.")
    scene = Scene(**parts, card=raw.get("card"))
    check(scene)
    return scene


def _table(table: str, raw: Any) -> Any:
    if not isinstance(raw, Mapping):
        raise ValueError(f"[{table}] must be a table of keys, got {raw!r}.")
    keys, values = KEYS[table], {}
    for key, value in raw.items():
        if key not in keys:
            raise ValueError(unknown_key(key, (*keys, *IN_FILES.get(table, ())), table))
        name, per = keys[key]
        where = f"{key} in [{table}]"
        values[name] = (_rows(where, value) if table == "drive" and key in MATRICES else
                        value_of(where, value, per, getattr(CLASSES[table](), name)))
    return CLASSES[table](**values)




def _rows(where: str, value: Any) -> tuple[Any, ...]:
    if not (isinstance(value, list | tuple) and value and all(isinstance(row, list | tuple) and row for row in value)):
        raise ValueError(f"{where} must hold rows of numbers or, in a file, the name of a CSV file of them, got "
                         f"{value!r:.80}.")
    return tuple(tuple(_rows(where, [cell])[0] if isinstance(cell, list | tuple) else _weight(where, cell)
                       for cell in row) for row in value)


def _weight(where: str, cell: Any) -> float:
    weight = value_of(where, cell, 1.0, 0.0)
    if abs(weight) > MOST_WEIGHT:
        raise ValueError(f"{where} must hold numbers from {-MOST_WEIGHT:g} to {MOST_WEIGHT:g}, got {weight:g}.")
    return weight


def _electrodes(raw: Any) -> Electrodes:
    """Electrodes, with lists of one number an electrode; an infinite contact impedance is a missing electrode."""
    lists = {key: value for key, value in raw.items() if key in EACH and isinstance(value, list)} if isinstance(
        raw, Mapping) else {}
    if isinstance(raw, Mapping) and math.inf in [raw.get(key) for key in IMPEDANCES]:
        raise ValueError("contact impedances in [electrodes] are one finite number or a list of one an electrode, inf "
                         "where it has no contact; or name those electrodes in missing.")
    given = _table("electrodes", {key: value for key, value in raw.items() if key not in lists} if lists else raw)
    values, open_ends = {}, set()
    for key, cells in lists.items():
        name, per = KEYS["electrodes"][key]
        infinite = [k for k, cell in enumerate(cells) if cell == math.inf and key != "width_mm"]
        open_ends.update(infinite if key == given.impedance_key else [])
        values[name] = tuple(value_of(f"{key} in [electrodes]", 1.0 if k in infinite else cell, per,
                                    Electrodes.shape if per is None else 0.0) for k, cell in enumerate(cells))
    if any(not isinstance(k, int | float) or k % 1 for k in given.missing):
        raise ValueError(f"missing in [electrodes] must hold numbers of electrodes, from 0, got {list(given.missing)}.")
    return replace(given, **values, missing=tuple(sorted(open_ends.union(int(k) for k in given.missing))))














