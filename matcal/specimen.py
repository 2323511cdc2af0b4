"""Sizes of the specimens, from `specimen.toml`: one table a kind, millimetres in the file, SI here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from matcal.errors import TestFileError
from matcal.toml_file import read_toml

DIRECTIONS = ("compression", "tension")
# how a volumetric test loads its specimen: by a piston on a fluid around it, or directly in a rigid sleeve
METHODS = ("hydrostatic", "confined")
_SHEET = {"length_mm", "width_mm", "thickness_mm", "compliance_mm_per_N", "preload_N", "direction"}
_DISC = {"diameter_mm", "width_mm", "depth_mm", "height_mm", "compliance_mm_per_N", "preload_N", "direction"}
# table -> keys it may hold
KEYS = {
    "uniaxial": _DISC,
    "relaxation": _DISC,
    "biaxial": _SHEET,
    "planar": _SHEET,
    "volumetric": {"method", "diameter_mm", "width_mm", "depth_mm", "height_mm", "lateral_ratio", "piston_diameter_mm",
                   "volume_mm3", "compliance_mm_per_N", "preload_N"},
    "shear": {"faces", "length_mm", "width_mm", "thickness_mm", "compliance_mm_per_N"},
    "conductivity": {"length_mm", "width_mm", "thickness_mm", "coating_um", "voltage_V"},
}


@dataclass(frozen=True)
class Block:
    """A specimen under load: stress = force/area, strain = displacement/length."""

    # loaded area (all faces together in shear, the piston's on a fluid), m2
    area_m2: float
    # height, or thickness in shear, length between the grips of a sheet, volume over piston area in a fluid, m
    length_m: float
    # what the frame itself gives per newton, m/N
    compliance_m_per_N: float = 0.0
    # load at which the height was measured, N; 0 where the contact point is looked for
    preload_N: float = 0.0
    # one of DIRECTIONS, or None where the file must tell
    direction: str | None = None
    # mean stress over axial stress of a volumetric test: 1 in a fluid, (1 + 2 lateral_ratio)/3 in a sleeve
    mean_share: float = 1.0
    # what the sizes say about the test, one sentence each
    notes: tuple[str, ...] = ()


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
    compliance, preload = size("compliance_mm_per_N", 0.0) * 1e-3, size("preload_N", 0.0)
    if kind == "shear":
        area = size("faces") * size("length_mm") * size("width_mm") * 1e-6
        return Block(area, size("thickness_mm") * 1e-3, compliance)
    if kind == "volumetric":
        return _volume(table, size, compliance, preload, path)
    direction = table.get("direction")
    if direction not in (None, *DIRECTIONS):
        raise TestFileError(path, f"[{kind}] direction '{direction}' is unknown; known: {', '.join(DIRECTIONS)}.")
    if kind in ("biaxial", "planar"):
        return sheet(kind, size("length_mm") * 1e-3, size("width_mm") * 1e-3, size("thickness_mm") * 1e-3, compliance,
                     preload, direction)
    return Block(_area(table, size), size("height_mm") * 1e-3, compliance, preload, direction)


def sheet(kind: str, length_m: float, width_m: float, thickness_m: float, compliance_m_per_N: float = 0.0,
          preload_N: float = 0.0, direction: str | None = None) -> Block:
    """A sheet pulled along one axis (planar) or both (biaxial): stress = force on one axis/(width x thickness)."""
    notes = ("Equibiaxial: force and travel are those of one of two equal axes, stress = force/(width x thickness).",)
    if kind == "planar":
        notes = ("Planar: stress = force/(width x thickness), the width taken as kept by the grips.",)
        if width_m < 4 * length_m:
            notes += (f"The sheet is only {width_m / length_m:.2g} times as wide as long; below 4 its edges draw in "
                      "and the test is not planar.",)
    return Block(width_m * thickness_m, length_m, compliance_m_per_N, preload_N, direction, notes=notes)


def _volume(table: Mapping[str, Any], size: Callable[..., float], compliance: float, preload: float,
            path: Path) -> Block:
    """A volumetric test from force and travel: J = 1 + (change of volume)/volume."""
    method = table.get("method")
    if method not in METHODS:
        raise TestFileError(path, f"[volumetric] method = {method!r} does not tell what the force is: write method = "
                                  "\"hydrostatic\" (piston on a fluid: piston_diameter_mm, volume_mm3) or \"confined\" "
                                  "(specimen in a rigid sleeve: diameter_mm, height_mm, lateral_ratio).")
    if method == "hydrostatic":
        piston = np.pi * (size("piston_diameter_mm") * 1e-3) ** 2 / 4
        return Block(piston, size("volume_mm3") * 1e-9 / piston, compliance, preload, "compression", notes=(
            "Hydrostatic: pressure = force/piston area, J = 1 - piston area x travel/volume of the specimen; the "
            "fluid's own compression counts only as far as the compliance covers it.",))
    if "lateral_ratio" not in table:
        raise TestFileError(path, "[volumetric] method = \"confined\" measures the axial stress, but the mean stress "
                                  "is wanted: add lateral_ratio, lateral over axial stress (nu/(1 - nu) at small "
                                  "strain; 0 for a foam with nu = 0, for which uniaxial= says the same).")
    ratio = size("lateral_ratio", 0.0)
    said = (f"Confined: J = 1 + axial strain, mean stress = axial stress x (1 + 2 x {ratio:g})/3 with the "
            "lateral_ratio given.",)
    return Block(_area(table, size), size("height_mm") * 1e-3, compliance, preload, "compression", (1 + 2 * ratio) / 3,
                 said)


def _area(table: Mapping[str, Any], size: Callable[..., float]) -> float:
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
