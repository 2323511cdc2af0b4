"""Limits of the values of a scene file, and what refuses them."""

import math
from collections.abc import Collection
from typing import Any

import numpy as np

from touchcal.document import is_number

# Least and largest value by unit, and of keys that differ, in the unit of the key: what is built and measured, with
# room; outside them a value is a slip of the unit.
_OF_UNITS = {"mm": (1e-3, 1e4), "um": (1e-3, 1e4), "N": (0.0, 1e9), "mA": (1e-9, 1e6), "deg": (-3600.0, 3600.0),
             "Ohm_m": (1e-12, 1e9), "Ohm_m2": (1e-12, 1e9), "s": (0.0, 1e12), "uS": (-1e9, 1e9), "S": (1e-12, 1e9)}
_OF_KEYS = {"x_mm": (-1e4, 1e4), "y_mm": (-1e4, 1e4), "depth_mm": (0.0, 1e4), "half_angle_deg": (1.0, 89.0),
            "tilt_deg": (-60.0, 60.0), "friction_coefficient": (0.0, 100.0), "signal": (1e-9, 1.0),
            "shares": (-100.0, 100.0), "positions_mm": (-1e5, 1e5), "points_mm": (-1e4, 1e4),
            "holes_mm": (-1e4, 1e4), "corner_radius_mm": (0.0, 1e4),
            "gains": (-100.0, 100.0), "current_factors": (0.0, 100.0), "sheet_modes": (-10.0, 10.0),
            "size_error": (0.0, 10.0), "low_mm": (0.0, 1e4), "high_mm": (0.0, 1e4), "along": (-100.0, 100.0),
            "across": (-100.0, 100.0), "base_thickness_mm": (0.0, 1e4)}


def plain(part: object) -> None:
    """Turn the numbers of NumPy among the fields of a dataclass, single or in a tuple or an array, into Python's."""
    for name, value in vars(part).items():
        if isinstance(value, np.generic):
            object.__setattr__(part, name, value.item())
        elif isinstance(value, np.ndarray):
            object.__setattr__(part, name, tuple(value.tolist()))
        elif isinstance(value, tuple) and any(isinstance(each, np.generic) for each in value):
            object.__setattr__(part, name, tuple(each.item() if isinstance(each, np.generic) else each
                                                 for each in value))


_KINDS = {bool: "true or false", int: "a whole number", str: "a word in quotes"}


def value_of(where: str, value: Any, per: float | None, default: Any) -> Any:
    if isinstance(default, tuple):
        cells = value if isinstance(value, list) else [value]
        return tuple(value_of(where, cell, per or 1.0, () if isinstance(cell, list) else 0.0) for cell in cells)
    if per is not None:
        if not is_number(value):
            raise ValueError(f"{where} must be a finite number, got {value!r}.")
        return float(value) / per
    if type(value) is not type(default):
        raise ValueError(f"{where} must be {_KINDS[type(default)]}, got {value!r}.")
    return value


def check_limits(table: str, key: str, value: Any, per: float | None) -> None:
    """ValueError where a value, or one of several, lies outside its key's limits; what has no contact is infinite."""
    unit = next((unit for unit in sorted(_OF_UNITS, key=len, reverse=True) if key.endswith(f"_{unit}")), "")
    least, most = _OF_KEYS.get(key) or _OF_UNITS.get(unit, (-math.inf, math.inf))
    for each in _flat(value):
        if math.isinf(most) or each is None or (unit.startswith("Ohm") and each == math.inf and table == "electrodes"):
            continue
        found = each * (per or 1.0) if is_number(each) else math.nan
        require(least * (1 - 1e-9) <= found <= most * (1 + 1e-9) or least == found, f"{key} in [{table}]",
                 "must be positive" if found <= 0 < least else
                 f"must be from {least:g} to {most:g} {unit.replace('_', ' ')}".rstrip(),
                 f"{found:g}" if is_number(each) else repr(each))


def _flat(value: Any) -> tuple[Any, ...]:
    """The parts of a value that are no tuples."""
    return tuple(part for each in value for part in _flat(each)) if isinstance(value, tuple) else (value,)


def require(ok: bool, where: str, expected: str, value: Any) -> None:
    if not ok:
        raise ValueError(f"{where} {expected}, got {value}.")


def one_of(where: str, value: str, known: Collection[str]) -> None:
    if value not in [*known]:
        raise ValueError(f"{where}: '{value}' is unknown; known: {', '.join(known)}.")
