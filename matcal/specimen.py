"""Sizes of the specimens, from `specimen.toml`: one table a kind, millimetres in the file, SI here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from matcal.errors import TestFileError
from matcal.toml_file import read_toml

DIRECTIONS = ("compression", "tension")
_DISC = {"diameter_mm", "width_mm", "depth_mm", "height_mm", "compliance_mm_per_N", "preload_N", "direction"}
# table -> keys it may hold
KEYS = {
    "uniaxial": _DISC,
    "relaxation": _DISC,
    "shear": {"faces", "length_mm", "width_mm", "thickness_mm", "compliance_mm_per_N"},
    "conductivity": {"length_mm", "width_mm", "thickness_mm", "coating_um", "voltage_V"},
}


@dataclass(frozen=True)
class Block:
    """A specimen under load: stress = force/area, strain = displacement/length."""

    # loaded area (all faces together in shear), m2
    area_m2: float
    # height, or thickness in shear, m
    length_m: float
    # what the frame itself gives per newton, m/N
    compliance_m_per_N: float = 0.0
    # load at which the height was measured, N; 0 where the contact point is looked for
    preload_N: float = 0.0
    # one of DIRECTIONS, or None where the file must tell
    direction: str | None = None


@dataclass(frozen=True)
class Strip:
    """A coated strip under voltage."""

    # length between the electrodes, m
    length_m: float
    # cross-section of the coating ring at its constant thickness, 2 (width + thickness) x coating, m2
    ring_area_m2: float
    # applied voltage, V; None where the potentiostat's own column is to be used
    voltage_V: float | None = None


def read_specimen(path: Path) -> dict[str, Block | Strip]:
    """kind -> specimen; TestFileError names an unknown table or key, a missing one, or a size that is not positive."""
    tables = {name: table for name, table in read_toml(path).items() if name != "kind"}
    if unknown := sorted(set(tables) - set(KEYS)):
        raise TestFileError(path, f"unknown table or key '{unknown[0]}'; known tables: {', '.join(KEYS)}.")
    return {kind: _specimen(kind, table, path) for kind, table in tables.items()}


def _specimen(kind: str, table: Any, path: Path) -> Block | Strip:
    if not isinstance(table, Mapping):
        raise TestFileError(path, f"'{kind}' must be a table: write [{kind}] and its keys below it.")
    if unknown := sorted(set(table) - KEYS[kind]):
        known = ", ".join(sorted(KEYS[kind]))
        raise TestFileError(path, f"[{kind}] has the unknown key '{unknown[0]}'; known: {known}.")

    def size(key: str, default: float | None = None) -> float:
        return _size(table, key, default, kind, path)

    if kind == "conductivity":
        ring = 2 * (size("width_mm") + size("thickness_mm")) * 1e-3 * size("coating_um") * 1e-6
        return Strip(size("length_mm") * 1e-3, ring, size("voltage_V") if "voltage_V" in table else None)
    compliance = size("compliance_mm_per_N", 0.0) * 1e-3
    if kind == "shear":
        area = size("faces") * size("length_mm") * size("width_mm") * 1e-6
        return Block(area, size("thickness_mm") * 1e-3, compliance)
    direction = table.get("direction")
    if direction not in (None, *DIRECTIONS):
        raise TestFileError(path, f"[{kind}] direction '{direction}' is unknown; known: {', '.join(DIRECTIONS)}.")
    return Block(_area(table, size), size("height_mm") * 1e-3, compliance, size("preload_N", 0.0), direction)


def _area(table: Mapping[str, Any], size: Any) -> float:
    if "diameter_mm" in table or not {"width_mm", "depth_mm"} <= set(table):
        return np.pi * (size("diameter_mm") * 1e-3) ** 2 / 4
    return size("width_mm") * size("depth_mm") * 1e-6


def _size(table: Mapping[str, Any], key: str, default: float | None, kind: str, path: Path) -> float:
    """A positive number (zero allowed where there is a default); TestFileError otherwise."""
    value = table.get(key, default)
    if value is None:
        raise TestFileError(path, f"[{kind}] needs the key {key}.")
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) \
            or value < 0 or (value == 0 and default is None):
        raise TestFileError(path, f"[{kind}] {key} = {value!r} must be a positive number.")
    return float(value)
