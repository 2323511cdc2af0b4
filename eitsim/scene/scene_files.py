"""The tables of a scene file with everything that they name in other files, or for short, written out."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.calibrated_electrodes import with_calibrated
from eitsim.scene.drive import with_matrices
from eitsim.scene.drive_pairs import with_pairs
from eitsim.scene.electrodes import FEWEST, MOST, Electrodes
from eitsim.scene.outline_edge import arc_at, arcs_of, edge_starts
from eitsim.scene.outline_files import Corners, line_groups, outline_of_file
from eitsim.scene.polygons import KINDS, Looped, Loops, turned
from eitsim.scene.triangles.punch_files import with_shapes
from touchcal.arrays import Array
from touchcal.csv_numbers import csv_rows
from touchcal.document import is_number
from touchcal.errors import InputFileError

# Columns of a file of electrodes on the surface, and those that it may leave out.
_PLACES, _SIZES = ("x_mm", "y_mm"), ("width_mm", "length_mm", "turn_deg", "contact_impedance_Ohm_m2", "shape")

_LEAST_MM = 2.0  # A skin whose longer side is shorter than this is not meant.
_WIDTH_MM = 1e3 * float(np.max(Electrodes.width_m))
_GIVEN = ("count", "width_mm", "first_angle_deg", "clockwise", "angles_deg", "positions_mm", "shares", "x_mm", "y_mm",
          "grid", "places")
_OFF = 1e-4  # Distance from the outer edge, and gap between a group's lines, over the edge's length.
_NUMBERED = re.compile(r"(.*?)(\d+)")


def with_files(raw: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene, design or sensor file that need no other file from here on: matrices and pairs of [drive],
    the outline of [body], and the grid, the places, the groups of lines or the calibrated sensor of [electrodes]
    written out, files of shapes in [punch] and of the base's card in [skin] by their whole paths. Names are relative to
    `folder`; ValueError names the key, InputFileError the file."""
    tables = with_calibrated(with_shapes(with_matrices(raw, folder), folder), folder)
    if isinstance(body := tables.get("body"), Mapping):
        tables["body"] = _with_outline(body, tables.get("electrodes", {}), folder)
        if isinstance(own := tables.get("electrodes", {}), Mapping):
            tables |= _from_lines(own, body, tables["body"], folder)
    if isinstance(skin := tables.get("skin"), Mapping) and (name := skin.get("base_card")):
        tables["skin"] = {**skin, "base_card": _base_card(name, folder)}
    if isinstance(electrodes := tables.get("electrodes"), Mapping):
        tables["electrodes"] = _with_places(electrodes, folder)
    if isinstance(drive := tables.get("drive"), Mapping) and "pairs" in drive:
        tables["drive"] = with_pairs(drive, _count(tables.get("electrodes", {})), folder)
    return tables


def _base_card(name: Any, folder: Path) -> str:
    """The whole path of a base's card; ValueError where it is no name of a file that is there."""
    if not isinstance(name, str):
        raise ValueError(f"base_card in [skin] must be the name of one card's file, got {name!r:.80}. To vary the "
                         "base, write a design for each.")
    if not (path := (folder / name).resolve()).is_file():
        raise ValueError(f"base_card in [skin]: there is no file {name}, relative to the scene's folder.")
    return str(path)


def _count(electrodes: Any) -> int:
    """How many electrodes the table [electrodes] has."""
    count = electrodes.get("count", Electrodes.count) if isinstance(electrodes, Mapping) else None
    if type(count) is not int or not FEWEST <= count <= MOST:
        raise ValueError(f"count in [electrodes] must be a whole number from {FEWEST} to {MOST}, got {count!r:.80}.")
    return count


def _with_outline(body: Mapping[str, Any], electrodes: Any, folder: Path) -> dict[str, Any]:
    """The table [body], a file that outline or points_mm names replaced by the corners it holds, mm."""
    if "mesh" in body:
        raise ValueError("mesh in [body] is a sheet without a layer, which `eitsim solve-mesh` reads; for punches give "
                         "its file as surface, with thickness_mm.")
    name = body.get("outline")
    if isinstance(name, str) and name not in ("disc", *KINDS) and "." in name:
        if "points_mm" in body:
            raise ValueError(f"points_mm in [body] has no effect with outline = \"{name}\"; leave it out.")
        outer, holes = _corners(folder / name, body, electrodes)
        held = [*holes, *body.get("holes_mm", [])]
        kept = {key: value for key, value in body.items() if key != "unit_mm"}
        return {**kept, "outline": "polygon", "points_mm": outer} | ({"holes_mm": held} if held else {})
    if isinstance(points := body.get("points_mm"), str):
        kept = {key: value for key, value in body.items() if key != "unit_mm"}
        return {**kept, "points_mm": _corners(folder / points, body, electrodes)[0]}
    if "unit_mm" in body:
        raise ValueError("unit_mm in [body] has no effect without a file that outline or points_mm names; leave it "
                         "out, and give lengths in mm.")
    return dict(body)


def _from_lines(electrodes: Mapping[str, Any], body: Mapping[str, Any], read: Mapping[str, Any],
                folder: Path) -> dict[str, Any]:
    """The table [electrodes], `groups` replaced by the middles and widths of the lines of the outline's mesh that are
    named so and numbered; InputFileError where groups look like electrodes and no key says where electrodes lie."""
    name = next((body[key] for key in ("outline", "points_mm") if "." in str(body.get(key))
                 and isinstance(body[key], str)), None)
    if name is None:
        if "groups" in electrodes:
            raise ValueError("groups in [electrodes] needs a mesh that outline in [body] names; leave it out.")
        return {}
    path = folder / name
    found = line_groups(path, body.get("unit_mm", 1.0))
    names = sorted((name for name in found if _NUMBERED.fullmatch(name)), key=_number)
    if "groups" not in electrodes:
        if len(names) >= FEWEST and not {*_GIVEN[4:]} & set(electrodes):
            raise InputFileError(path, f"it names groups of lines, {', '.join(names[:3])} ... If they are electrodes, "
                                       f"write groups = \"{_prefix(names[0])}\" in [electrodes]; if not, give places "
                                       "there, as shares.")
        return {}
    if other := [key for key in _GIVEN if key in electrodes]:
        raise ValueError(f"{other[0]} in [electrodes] has no effect with groups; leave it out.")
    chosen = [name for name in names if _prefix(name) == electrodes["groups"]]
    if len(chosen) < FEWEST:
        raise InputFileError(path, f"groups in [electrodes]: at least {FEWEST} groups of lines must be named "
                                   f"{electrodes['groups']} and a number; it has {', '.join(found) or 'none'}.")
    outline = Loops((turned(1e-3 * np.array(read["points_mm"], dtype=float), 1.0),))
    places = [_along(path, name, 1e-3 * found[name], outline) for name in chosen]
    kept = {key: value for key, value in electrodes.items() if key != "groups"}
    made = {"positions_mm": [1e3 * middle for middle, _ in places], "width_mm": [1e3 * width for _, width in places]}
    return {"electrodes": {**kept, "count": len(chosen), **made}}


def _along(path: Path, name: str, lines_m: Array, outline: Looped) -> tuple[float, float]:
    """Middle, from the direction +x counter-clockwise, and length, m, of lines along the outer edge."""
    whole = edge_starts(outline)[-1]
    arc, away = arcs_of(outline, lines_m.mean(axis=1))
    length = np.linalg.norm(lines_m[:, 1] - lines_m[:, 0], axis=1)
    from_first = np.mod(arc - arc[0] + whole / 2, whole) - whole / 2
    width = float(np.max(from_first + length / 2) - np.min(from_first - length / 2))
    if away.max() > _OFF * whole or abs(width - length.sum()) > _OFF * whole:
        raise InputFileError(path, f"groups in [electrodes]: the lines of {name} are no one stretch of the outer edge. "
                                   "Give the electrodes by positions_mm, or by x_mm and y_mm.")
    middle = arc[0] + (np.max(from_first + length / 2) + np.min(from_first - length / 2)) / 2
    return float(np.mod(middle - arc_at(outline, 0.0), whole)), width


def _prefix(name: str) -> str:
    return _NUMBERED.sub(r"\1", name)


def _number(name: str) -> tuple[str, int]:
    return _prefix(name), int(_NUMBERED.sub(r"\2", name))


def _corners(path: Path, body: Mapping[str, Any], electrodes: Any) -> tuple[Corners, list[Corners]]:
    """The loops of a file, mm; InputFileError where no unit is stated and its numbers can be no mm: the skin is tiny,
    or the electrodes do not fit on its edge."""
    unit = body.get("unit_mm", 1.0)
    if not (is_number(unit) and unit > 0):
        raise ValueError(f"unit_mm in [body] must be a positive number, the length of one unit of the file in mm, got "
                         f"{unit!r:.80}.")
    outer, holes = outline_of_file(path, unit)
    points = np.array(outer)
    sides, edge = np.ptp(points, axis=0), float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum())
    if "unit_mm" not in body and (sides.max() < _LEAST_MM or edge < _taken_mm(electrodes)):
        raise InputFileError(path, f"it is {sides[0]:.4g} by {sides[1]:.4g} mm large if its lengths are mm, too small "
                                   "for the electrodes. They seem to be in metres, or another unit: write unit_mm = "
                                   "1000 (metres), 10 (cm) or 25.4 (inches) in [body], or unit_mm = 1 if they are mm.")
    return outer, holes


def _taken_mm(electrodes: Any) -> float:
    """Length of edge, mm, that evenly wide electrodes along it take; 0 for others."""
    if not isinstance(electrodes, Mapping) or "groups" in electrodes or not Electrodes(
            str(electrodes.get("kind", Electrodes.kind))).along_edge:
        return 0.0
    count, width = electrodes.get("count", Electrodes.count), electrodes.get("width_mm", _WIDTH_MM)
    return count * width if is_number(count) and is_number(width) else 0.0


def _with_places(electrodes: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The table [electrodes], its grid, or the file that places names, replaced by x_mm and y_mm of each electrode."""
    kept = {key: value for key, value in electrodes.items() if key not in ("grid", "pitch_mm", "places")}
    if "grid" in electrodes and "places" in electrodes:
        raise ValueError("places in [electrodes] has no effect with grid; leave one of them out.")
    if "grid" in electrodes:
        kept |= _grid(electrodes)
    elif "pitch_mm" in electrodes:
        raise ValueError("pitch_mm in [electrodes] has no effect without grid = [columns, rows]; give it.")
    elif "places" in electrodes:
        kept |= _listed(folder / str(electrodes["places"]))
    if isinstance(kept.get("x_mm"), list):
        kept = {"count": len(kept["x_mm"])} | kept
    return kept


def _grid(electrodes: Mapping[str, Any]) -> dict[str, list[float]]:
    """x_mm and y_mm of a grid about the origin, row by row from the lowest, each from the left."""
    grid, pitch = electrodes["grid"], electrodes.get("pitch_mm")
    if not (isinstance(grid, list) and len(grid) == 2 and all(type(n) is int and n > 0 for n in grid)):
        raise ValueError(f"grid in [electrodes] must hold columns and rows as [6, 4], got {grid!r:.80}.")
    if grid[0] * grid[1] > MOST:
        raise ValueError(f"grid in [electrodes] has {grid[0] * grid[1]} electrodes; at most {MOST} are solved.")
    if not (isinstance(pitch, list) and len(pitch) == 2 and all(is_number(p) and p > 0 for p in pitch)):
        raise ValueError("pitch_mm in [electrodes] must hold the steps of grid along x and y as [18, 18], got "
                         f"{pitch!r:.80}.")
    if other := [key for key in ("x_mm", "y_mm") if key in electrodes]:
        raise ValueError(f"{other[0]} in [electrodes] has no effect with grid; leave it out.")
    x, y = ((np.arange(n) - (n - 1) / 2) * step for n, step in zip(grid, pitch, strict=True))
    return {"x_mm": np.tile(x, grid[1]).tolist(), "y_mm": np.repeat(y, grid[0]).tolist()}


def _listed(path: Path) -> dict[str, list[Any]]:
    """Columns of a file of electrodes: x_mm and y_mm, and what it gives of each one's size."""
    if not path.exists():
        raise InputFileError(path, "no such file, which places in [electrodes] names. Check the name, which is "
                                   "relative to the scene file.")
    rows = csv_rows(path, "one row an electrode")
    names = rows[0][1] if rows else []
    known = (*_PLACES, *_SIZES)
    if not set(_PLACES) <= set(names) or not set(names) <= set(known):
        raise InputFileError(path, f"its header must name {', '.join(_PLACES)} and may name {', '.join(_SIZES)}; got "
                                   f"{', '.join(names) or 'nothing'}.")
    out: dict[str, list[Any]] = {name: [] for name in names}
    for line, row in rows[1:]:
        if len(row) != len(names):
            raise InputFileError(path, f"{len(row)} columns, expected {len(names)}.", line=line)
        for name, cell in zip(names, row, strict=True):
            try:
                out[name].append(cell if name == "shape" else float(cell))
            except ValueError:
                raise InputFileError(path, f"{name}: '{cell}' is no number.", line=line) from None
    return out
