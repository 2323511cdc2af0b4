"""Sizes of the specimens, from `specimen.toml`: one table a kind, millimetres in the file, SI here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from matcal.reduction.loading_direction import DIRECTIONS
from touchcal.document import is_number
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

# how a volumetric test loads its specimen: by a piston on a fluid around it, or directly in a rigid sleeve
METHODS = ("hydrostatic", "confined")
_SHEET = {"length_mm", "width_mm", "thickness_mm", "compliance_mm_per_N", "preload_N", "direction"}
_DISC = {"area_mm2", "diameter_mm", "width_mm", "depth_mm", "height_mm", "compliance_mm_per_N", "preload_N",
         "direction"}
# ways to give a cross-section, the first that a table has counts and the others must agree
SECTIONS = (("area_mm2",), ("diameter_mm",), ("width_mm", "depth_mm"))
# Least and largest value of a key, in its unit: 1 um to 10 m; below the least only 0 where it may be left out.
_OF_UNITS = {"mm": (1e-3, 1e4), "mm2": (1e-6, 1e8), "mm3": (1e-9, 1e12), "um": (1e-3, 1e5),
             "mm_per_N": (0.0, 1e3), "N": (0.0, 1e7), "V": (1e-9, 1e5), "ratio": (0.0, 1.0),
             "Ohm": (1e-9, 1e15)}
MOST_FACES = 100
SAME = 0.01  # areas that differ by less are one
# table -> keys it may hold
KEYS = {
    "uniaxial": _DISC,
    "relaxation": _DISC,
    "biaxial": _SHEET,
    "planar": _SHEET,
    "volumetric": {"method", "diameter_mm", "width_mm", "depth_mm", "height_mm", "lateral_ratio", "piston_diameter_mm",
                   "volume_mm3", "compliance_mm_per_N", "preload_N"},
    "shear": {"area_mm2", "faces", "length_mm", "width_mm", "thickness_mm", "compliance_mm_per_N"},
    "conductivity": {"length_mm", "width_mm", "thickness_mm", "coating_um", "area_mm2", "voltage_V", "direction",
                     "rest_resistance_Ohm", "series_resistance_Ohm"},
}


@dataclass(frozen=True)
class Block:
    """A specimen under load: stress = force/area, strain = displacement/length."""

    area_m2: float  # loaded area (all faces together in shear, the piston's on a fluid), m2
    length_m: float  # height, m; thickness in shear, length between grips of a sheet, volume over piston area in fluid
    compliance_m_per_N: float = 0.0  # what the frame itself gives per newton, m/N
    preload_N: float = 0.0  # load at which the height was measured, N; 0 where the contact point is looked for
    direction: str | None = None  # one of DIRECTIONS, or None where the file must tell
    mean_share: float = 1.0  # mean over axial stress, volumetric: 1 in a fluid, (1 + 2 lateral_ratio)/3 in a sleeve
    notes: tuple[str, ...] = ()  # what the sizes say about the test, one sentence each
    compliance_stated: bool = False  # whether the specimen's table states what the frame gives


@dataclass(frozen=True)
class Strip:
    """A coated strip, or a block that conducts throughout, under voltage."""

    length_m: float  # length between the electrodes, m
    # cross-section that conducts, kept as the strip is strained, m2: of a coating ring 2 (width + thickness) x coating,
    # of a block its area
    ring_area_m2: float
    voltage_V: float | None = None  # applied voltage, V; None where the potentiostat's own column is to be used
    direction: str | None = None  # one of DIRECTIONS, or None where the files must tell
    rest_resistance_Ohm: float | None = None  # resistance at rest, Ohm, that a relative one refers to
    coated: bool = True  # whether the area is that of a coating ring
    # resistor in series with the specimen, Ohm; the applied voltage is then over both
    series_resistance_Ohm: float | None = None


def read_tables(path: Path) -> dict[str, Mapping[str, Any]]:
    """kind -> its keys, which need not be complete; InputFileError names an unknown table or key."""
    tables = {name: table for name, table in read_toml(path).items() if name != "kind"}
    if unknown := sorted(set(tables) - set(KEYS)):
        stray = any(unknown[0] in keys for keys in KEYS.values())
        fix = f" Write it below the line of its test, for example [{next(iter(KEYS))}]." if stray else ""
        raise InputFileError(path, f"unknown table or key '{unknown[0]}'; known tables: {', '.join(KEYS)}.{fix}")
    for kind, table in tables.items():
        if not isinstance(table, Mapping):
            raise InputFileError(path, f"'{kind}' must be a table: write [{kind}] and its keys below it.")
        if strange := sorted(set(table) - KEYS[kind]):
            known = ", ".join(sorted(KEYS[kind]))
            raise InputFileError(path, f"[{kind}] has the unknown key '{strange[0]}'; known: {known}.")
    return tables


def make_specimen(kind: str, table: Mapping[str, Any], path: Path) -> Block | Strip:
    """The specimen that the keys of one table make; InputFileError, in the name of `path`, where a key is missing, a
    size is not positive, or two ways to give the cross-section differ."""
    made = _made(kind, table, path)
    return replace(made, compliance_stated="compliance_mm_per_N" in table) if isinstance(made, Block) else made


def _made(kind: str, table: Mapping[str, Any], path: Path) -> Block | Strip:
    def size(key: str, default: float | None = None) -> float:
        return _size(table, key, default, kind, path)

    if kind == "conductivity":
        return _strip(table, size, path)
    compliance, preload = size("compliance_mm_per_N", 0.0) * 1e-3, size("preload_N", 0.0)
    if kind == "shear":
        faces = ("faces", "length_mm", "width_mm")
        area = _same_area(table, size, (("area_mm2",), faces) if "area_mm2" in table else (faces,), kind, path)
        return Block(area, size("thickness_mm") * 1e-3, compliance)
    if kind == "volumetric":
        return _volume(table, size, compliance, preload, path)
    direction = known_direction(table["direction"], kind, path) if "direction" in table else None
    if kind in ("biaxial", "planar"):
        return sheet(kind, size("length_mm") * 1e-3, size("width_mm") * 1e-3, size("thickness_mm") * 1e-3, compliance,
                     preload, direction)
    return Block(_same_area(table, size, SECTIONS, kind, path), size("height_mm") * 1e-3, compliance, preload,
                 direction)


def _strip(table: Mapping[str, Any], size: Callable[..., float], path: Path) -> Strip:
    """A coated strip, or a block with `area_mm2`; InputFileError where both are given."""
    ring = {"width_mm", "thickness_mm", "coating_um"} & set(table)
    if "area_mm2" in table and ring:
        raise InputFileError(path, f"[conductivity] gives area_mm2, of a block that conducts throughout, and "
                                   f"{sorted(ring)[0]}, of a coated strip. Leave one of them out.")
    if "area_mm2" not in table and not ring:
        raise InputFileError(path, "[conductivity] does not tell what conducts. Add width_mm, thickness_mm and "
                                   "coating_um of a coated strip, or area_mm2 of a block that conducts throughout.")
    if ring and (missing := {"width_mm", "thickness_mm", "coating_um"} - ring):
        raise InputFileError(path, f"[conductivity] needs the key {sorted(missing)[0]} of a coated strip. A block that "
                                   "conducts throughout has area_mm2 instead of width_mm, thickness_mm and coating_um.")
    area = (size("area_mm2") * 1e-6 if "area_mm2" in table else
            2 * (size("width_mm") + size("thickness_mm")) * 1e-3 * size("coating_um") * 1e-6)
    direction = known_direction(table["direction"], "conductivity", path) if "direction" in table else None
    known = {key: size(key) for key in ("voltage_V", "rest_resistance_Ohm", "series_resistance_Ohm")
             if key in table}
    return Strip(size("length_mm") * 1e-3, area, known.get("voltage_V"), direction, known.get("rest_resistance_Ohm"),
                 "area_mm2" not in table, known.get("series_resistance_Ohm"))


def known_direction(direction: Any, kind: str, path: Path) -> str:
    """The direction, one of DIRECTIONS; InputFileError for any other."""
    if direction not in DIRECTIONS:
        raise InputFileError(path, f"[{kind}] direction '{direction}' is unknown; known: {', '.join(DIRECTIONS)}.")
    return str(direction)


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
        raise InputFileError(path, f"[volumetric] method = {method!r} does not tell what the force is: write method = "
                                   '"hydrostatic" (piston on a fluid: piston_diameter_mm, volume_mm3) or "confined" '
                                   "(specimen in a rigid sleeve: diameter_mm, height_mm, lateral_ratio).")
    if method == "hydrostatic":
        piston = np.pi * (size("piston_diameter_mm") * 1e-3) ** 2 / 4
        return Block(piston, size("volume_mm3") * 1e-9 / piston, compliance, preload, "compression", notes=(
            "Hydrostatic: pressure = force/piston area, J = 1 - piston area x travel/volume of the specimen; the "
            "fluid's own compression counts only as far as the compliance covers it.",))
    if "lateral_ratio" not in table:
        raise InputFileError(path, "[volumetric] method = \"confined\" measures the axial stress, but the mean stress "
                                   "is required: add lateral_ratio, lateral over axial stress (nu/(1 - nu) at small "
                                   "strain; 0 for a foam with nu = 0, for which uniaxial= says the same).")
    ratio = size("lateral_ratio", 0.0)
    said = (f"Confined: J = 1 + axial strain, mean stress = axial stress x (1 + 2 x {ratio:g})/3 with the "
            "lateral_ratio given.",)
    return Block(_same_area(table, size, SECTIONS[1:], "volumetric", path), size("height_mm") * 1e-3, compliance,
                 preload, "compression", (1 + 2 * ratio) / 3, said)


def _same_area(table: Mapping[str, Any], size: Callable[..., float], ways: Sequence[tuple[str, ...]], kind: str,
               path: Path) -> float:
    """The area, m2, by the first way that the table has; InputFileError where it has none, or another one differs."""
    whole = [way for way in ways if set(way) <= set(table)]
    if not whole:
        begun = next((way for way in ways if set(way) & set(table)), ways[-1] if len(ways) == 1 else ("diameter_mm",))
        size(next(key for key in begun if key not in table))
    for way in ways:
        if (stray := [key for key in way if key in table]) and way not in whole and not any(
                set(stray) <= set(other) for other in whole):
            needed = next(key for key in way if key not in table)
            raise InputFileError(path, f"[{kind}] {stray[0]} has no effect without {needed}. Add that, or leave it "
                                       "out.")
    areas = {way: _area_of(way, size) for way in whole}
    first, *others = areas
    for other in others:
        if abs(areas[other] / areas[first] - 1) > SAME:
            stated = " but ".join(f"{' x '.join(f'{key} = {table[key]:g}' for key in way)} ({areas[way] * 1e6:.4g} mm2)"
                                  for way in (first, other))
            raise InputFileError(path, f"[{kind}] gives two cross-sections: {stated}. Leave one of them out.")
    return areas[first]


def _area_of(way: tuple[str, ...], size: Callable[..., float]) -> float:
    sizes = [size(key) for key in way]
    return float(np.pi * (sizes[0] * 1e-3) ** 2 / 4 if way == ("diameter_mm",) else np.prod(sizes) * 1e-6)


def _size(table: Mapping[str, Any], key: str, default: float | None, kind: str, path: Path) -> float:
    """A positive number (zero allowed where there is a default); InputFileError otherwise."""
    value = table.get(key, default)
    if value is None:
        raise InputFileError(path, f"[{kind}] needs the key {key}.")
    if not is_number(value) or value < 0 or (value == 0 and default is None):
        raise InputFileError(path, f"[{kind}] {key} = {value!r} must be a positive number.")
    if key == "faces" and (value != int(value) or value > MOST_FACES):
        raise InputFileError(path, f"[{kind}] faces = {value!r} must be a whole number from 1 to {MOST_FACES}.")
    least, most = next((ends for unit, ends in _OF_UNITS.items() if key.endswith(f"_{unit}")), (0.0, MOST_FACES))
    if value and not least <= value <= most:
        raise InputFileError(path, f"[{kind}] {key} = {value:g} must be from {least:g} to {most:g}; check its unit.")
    return float(value)
