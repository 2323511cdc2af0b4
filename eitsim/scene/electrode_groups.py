"""Electrodes of an outline that the groups of lines of its mesh name, as Gmsh writes them: elec1, elec2 ..."""

import re
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.electrodes import FEWEST
from eitsim.scene.mesh_file import read_mesh
from eitsim.scene.outline import Outline
from eitsim.scene.outline_electrodes import arc_at, arcs_of, edge_starts
from touchcal.arrays import Array
from touchcal.errors import InputFileError

_GIVEN = ("count", "width_mm", "first_angle_deg", "clockwise", "angles_deg", "positions_mm", "shares", "x_mm", "y_mm",
          "grid", "places")
_DRAWN = (".csv", ".dxf", ".svg")
_OFF = 1e-4  # Distance from the outer edge, and gap between a group's lines, over the edge's length.
_NUMBERED = re.compile(r"(.*?)(\d+)")


def with_groups(electrodes: Mapping[str, Any], path: Path, unit_mm: float, outline: Outline) -> dict[str, Any]:
    """The table [electrodes], `groups` replaced by the middles and widths of the lines of a mesh that are named so and
    numbered; InputFileError where groups look like electrodes and no key says where electrodes lie."""
    found = {} if path.suffix.lower() in _DRAWN else line_groups(path, unit_mm)
    names = sorted((name for name in found if _NUMBERED.fullmatch(name)), key=_number)
    if "groups" not in electrodes:
        if len(names) >= FEWEST and not {*_GIVEN[4:]} & set(electrodes):
            raise InputFileError(path, f"it names groups of lines, {', '.join(names[:3])} ... If they are electrodes, "
                                       f"write groups = \"{_prefix(names[0])}\" in [electrodes]; if not, give places "
                                       "there, as shares.")
        return dict(electrodes)
    if other := [key for key in _GIVEN if key in electrodes]:
        raise ValueError(f"{other[0]} in [electrodes] has no effect with groups; leave it out.")
    chosen = [name for name in names if _prefix(name) == electrodes["groups"]]
    if len(chosen) < FEWEST:
        raise InputFileError(path, f"groups in [electrodes]: at least {FEWEST} groups of lines must be named "
                                   f"{electrodes['groups']} and a number; it has {', '.join(found) or 'none'}.")
    places = [_along(path, name, 1e-3 * found[name], outline) for name in chosen]
    kept = {key: value for key, value in electrodes.items() if key != "groups"}
    return kept | {"count": len(chosen), "positions_mm": [1e3 * middle for middle, _ in places],
                   "width_mm": [1e3 * width for _, width in places]}


def line_groups(path: Path, unit_mm: float) -> dict[str, Array]:
    """Name -> ends (lines, 2, 2), mm, of the lines of a mesh in each named group of lines."""
    mesh, found = read_mesh(path), defaultdict(list)
    names = {int(tag): name for name, (tag, dimension) in mesh.field_data.items() if dimension == 1}
    for block, tags in zip(mesh.cells, mesh.cell_data.get("gmsh:physical", []), strict=False):
        for tag in np.unique(tags) if block.type.startswith("line") else ():
            if int(tag) in names:
                found[names[int(tag)]].append(unit_mm * mesh.points[block.data[tags == tag, :2]][..., :2])
    return {name: np.concatenate(lines) for name, lines in found.items()}


def _along(path: Path, name: str, lines_m: Array, outline: Outline) -> tuple[float, float]:
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
