"""The tables of a scene file with everything that they name in other files, or for short, written out."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.calibrated_electrodes import with_calibrated
from eitsim.scene.drive import with_matrices
from eitsim.scene.drive_pairs import with_pairs
from eitsim.scene.electrodes import FEWEST, MOST, Electrodes
from eitsim.scene.outline import OUTLINES
from eitsim.scene.outline_files import outline_of_file
from touchcal.csv_numbers import csv_rows
from touchcal.document import is_number
from touchcal.errors import InputFileError

# Columns of a file of electrodes on the surface, and those that it may leave out.
_PLACES, _SIZES = ("x_mm", "y_mm"), ("width_mm", "length_mm", "turn_deg", "contact_impedance_Ohm_m2", "shape")


def with_files(raw: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene, design or sensor file that need no other file from here on: matrices and pairs of [drive],
    the outline of [body], and the grid, the places or the calibrated sensor of [electrodes] written out. Names are
    relative to `folder`; ValueError names the key, InputFileError the file."""
    tables = with_calibrated(with_matrices(raw, folder), folder)
    if isinstance(body := tables.get("body"), Mapping):
        tables["body"] = _with_outline(body, folder)
    if isinstance(electrodes := tables.get("electrodes"), Mapping):
        tables["electrodes"] = _with_places(electrodes, folder)
    if isinstance(drive := tables.get("drive"), Mapping) and "pairs" in drive:
        tables["drive"] = with_pairs(drive, _count(tables.get("electrodes", {})), folder)
    return tables


def _count(electrodes: Any) -> int:
    """How many electrodes the table [electrodes] has."""
    count = electrodes.get("count", Electrodes.count) if isinstance(electrodes, Mapping) else None
    if type(count) is not int or not FEWEST <= count <= MOST:
        raise ValueError(f"count in [electrodes] must be a whole number from {FEWEST} to {MOST}, got {count!r:.80}.")
    return count


def _with_outline(body: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The table [body], a file that outline or points_mm names replaced by the corners it holds, mm."""
    if "mesh" in body:
        raise ValueError("mesh in [body]: a scene is a flat skin under a punch; mechanics on curved bodies is left "
                         "out. `eitsim solve-mesh` reads this table in the file of a curved skin.")
    name = body.get("outline")
    if isinstance(name, str) and name not in OUTLINES and "." in name:
        if "points_mm" in body:
            raise ValueError(f"points_mm in [body] has no effect with outline = \"{name}\"; leave it out.")
        outer, holes = outline_of_file(folder / name)
        held = [*holes, *body.get("holes_mm", [])]
        return {**body, "outline": "polygon", "points_mm": outer} | ({"holes_mm": held} if held else {})
    if isinstance(points := body.get("points_mm"), str):
        return {**body, "points_mm": outline_of_file(folder / points)[0]}
    return dict(body)


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
