"""Outlines from files: points (CSV), a drawing (DXF, SVG) or a triangle mesh that meshio reads; lengths in mm."""

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.mesh_file import read_mesh
from eitsim.scene.polygons import MOST_POINTS, signed_area
from touchcal.arrays import Array
from touchcal.csv_numbers import read_numbers
from touchcal.errors import InputFileError
from touchcal.lazy import needed

_SAG_MM = 0.01  # Largest distance of a curve of a drawing from its chords, mm.
_PER_INCH = 96.0  # User units of an SVG without units of its own.
_MM = 25.4 / _PER_INCH
_DRAWN = (".csv", ".dxf", ".svg")
_CORNERS = {"triangle": 3, "quad": 4}
_SAME_MM = 1e-3  # Ends of lines of a drawing closer than this are one corner, mm.

Corners = list[list[float]]


def outline_of_file(path: Path, unit_mm: float = 1.0) -> tuple[Corners, list[Corners]]:
    """Corners [x, y], mm, of the loop of a file that encloses most, then of the others, which are holes.

    unit_mm: the length of one unit of the file. Curves become chords that lie at most 0.01 mm off. InputFileError where
    the file holds no closed loop.
    """
    if not path.exists():
        raise InputFileError(path, "no such file, which outline or points_mm in [body] names. Check the name, which is "
                                   "relative to the scene file.")
    found = {".csv": _csv, ".dxf": _dxf, ".svg": _svg}.get(path.suffix.lower(), _mesh)(path, unit_mm)
    if not found:
        raise InputFileError(path, "it holds no closed loop; close the outline.")
    found.sort(key=lambda loop: -abs(signed_area(loop)))
    outer, *holes = [loop.tolist() for loop in found]
    return outer, holes


def line_groups(path: Path, unit_mm: float) -> dict[str, Array]:
    """Name -> ends (lines, 2, 2), mm, of the lines of a mesh in each named group of lines."""
    if path.suffix.lower() in _DRAWN:
        return {}
    mesh, found = read_mesh(path), defaultdict(list)
    names = {int(tag): name for name, (tag, dimension) in mesh.field_data.items() if dimension == 1}
    for block, tags in zip(mesh.cells, mesh.cell_data.get("gmsh:physical", []), strict=False):
        for tag in np.unique(tags) if block.type.startswith("line") else ():
            if int(tag) in names:
                found[names[int(tag)]].append(unit_mm * mesh.points[block.data[tags == tag, :2]][..., :2])
    return {name: np.concatenate(lines) for name, lines in found.items()}


def _csv(path: Path, unit_mm: float) -> list[Array]:
    return [unit_mm * read_numbers(path, 2, what="numbers x_mm, y_mm").values]


def _dxf(path: Path, unit_mm: float) -> list[Array]:
    needed("ezdxf", "outlines in .dxf files")
    from ezdxf import filemanagement, units
    from ezdxf import path as paths
    from ezdxf.lldxf.const import DXFError

    try:
        drawing = filemanagement.readfile(path)
    except (DXFError, OSError) as error:
        raise InputFileError(path, f"no DXF file that can be read ({error}).") from None
    if drawing.units not in (0, units.MM):  # 0: none is stated
        stated = f"{units.unit_name(drawing.units).lower()} ($INSUNITS {drawing.units})"
        raise InputFileError(path, f"it states {stated}, and lengths are read as mm. Save it in mm, or correct what it "
                                   "states.")
    curves = drawing.modelspace().query("LINE ARC CIRCLE ELLIPSE LWPOLYLINE POLYLINE SPLINE")
    return _joined(path, [unit_mm * np.array([[p.x, p.y] for p in paths.make_path(curve).flattening(
        _SAG_MM / unit_mm)])
                          for curve in curves])


def _svg(path: Path, unit_mm: float) -> list[Array]:
    svgelements: Any = needed("svgelements", "outlines in .svg files")
    try:
        drawing = svgelements.SVG.parse(str(path), ppi=_PER_INCH)
    except (ValueError, OSError, SyntaxError) as error:
        raise InputFileError(path, f"no SVG file that can be read ({error}).") from None
    shapes: list[Any] = [one for one in drawing.elements() if isinstance(one, svgelements.Shape)]
    parts = [part for shape in shapes for part in svgelements.Path(shape).as_subpaths()]
    return _joined(path, [unit_mm * _flattened(svgelements.Path(part)) for part in parts])


def _flattened(part: Any) -> Array:
    """Points of a path of an SVG, mm, its y upwards, straight pieces by their ends."""
    points: list[Any] = []
    for piece in part:
        if type(piece).__name__ == "Move":
            points.append(piece.end)
            continue
        straight = type(piece).__name__ in ("Line", "Close")
        # chords of a curve of length l that turns by at most a whole turn: the sag is below pi l / (4 n^2)
        chords = 1 if straight else max(4, math.ceil(math.sqrt(math.pi * _MM * piece.length() / (4 * _SAG_MM))))
        points += [piece.point(k / chords) for k in range(1, chords + 1)]
    return _MM * np.array([[p.x, -p.y] for p in points if p is not None])


def _mesh(path: Path, unit_mm: float) -> list[Array]:
    """Loops of the edges that one triangle, or quadrilateral, of a mesh has."""
    try:
        mesh = read_mesh(path)
    except (ValueError, OSError) as error:
        raise InputFileError(path, "no outline: neither .csv, .dxf, .svg nor a mesh that meshio reads "
                                   f"({error}).") from None
    cells = [block.data[:, :count] for block in mesh.cells for kind, count in _CORNERS.items()
             if block.type.startswith(kind)]
    if not cells:
        raise InputFileError(path, "the mesh has no triangles or quadrilaterals; save the skin's surface.")
    points = unit_mm * mesh.points
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > _SAME_MM:
        raise InputFileError(path, "the mesh is not flat in z. Touches of curved skins are not solved; "
                                   "`eitsim solve-mesh` gives readings of a curved skin.")
    edges = np.vstack([np.stack([block, np.roll(block, -1, axis=1)], axis=-1).reshape(-1, 2) for block in cells])
    _, index, times = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    if (count := int(np.sum(times == 1))) > MOST_POINTS:
        raise InputFileError(path, f"its edge has {count} corners, at most {MOST_POINTS} are taken; save a coarser "
                                   "mesh.")
    return _joined(path, list(points[edges[index[times == 1]]][..., :2]))


def _joined(path: Path, pieces: Sequence[Array]) -> list[Array]:
    """Closed loops of pieces, which are joined where their ends meet; InputFileError where one ends free."""
    ahead, loops = [piece for piece in pieces if len(piece) > 1], []
    while ahead:
        loop = ahead.pop(0)
        while np.linalg.norm(loop[0] - loop[-1]) > _SAME_MM:
            away = [(np.linalg.norm(piece[side] - loop[-1]), k, side) for k, piece in enumerate(ahead)
                    for side in (0, -1)]
            near, k, side = min(away, default=(math.inf, 0, 0))
            if near > _SAME_MM:
                at = ", ".join(f"{part:.6g}" for part in loop[-1])
                raise InputFileError(path, f"the outline is open at ({at}) mm; close it.")
            piece = ahead.pop(k)
            loop = np.vstack([loop, (piece if side == 0 else piece[::-1])[1:]])
        loops.append(loop[:-1])
    return loops
