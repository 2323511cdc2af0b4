"""Triangles in space from files that meshio reads, checked to be a sheet."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchcal.arrays import Array
from touchcal.errors import InputFileError

Indices = NDArray[np.int64]

_SAME = 1e-9  # Nodes nearer to each other than this part of the sheet's size are one.
_FLAT = 1e-12  # Least area of a triangle over the square of its longest side.
_LABELS = ("gmsh:physical", "medit:ref", "cell_tags", "group")  # Data of cells that number groups.


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A sheet in space."""

    name: str  # name of its file
    nodes_m: Array  # (n, 3) nodes, m
    cells: Indices  # (t, 3) corners, or (t, 6) with the middles of the edges after them, of quadratic triangles
    groups: Mapping[str | int, Indices]  # names and numbers of groups, and the triangles of each


def read_triangles(path: Path, unit_m: float = 1e-3) -> TriangleMesh:
    """The triangles of a file, in lengths of `unit_m`, m; quadratic ones keep their curves. InputFileError where it
    holds none, other cells of a surface, flat triangles, or edges that three triangles share."""
    if not path.exists():
        raise InputFileError(path, "no such file, which mesh in [body] names. Check the name, which is relative to the "
                                   "file of the skin.")
    import meshio

    try:
        with np.errstate(over="ignore"):  # meshio takes the first bytes of a text for a number of triangles
            mesh = meshio.read(path)
    except (meshio.ReadError, ValueError, KeyError, OSError, SystemExit) as error:
        raise InputFileError(path, f"no mesh that meshio reads ({error}).") from None
    kinds = {block.type for block in mesh.cells if block.dim == 2}
    if not kinds or not kinds <= {"triangle", "triangle6"} or len(kinds) > 1:
        raise InputFileError(path, "a sheet of triangles is solved, linear or quadratic ones, not both; got "
                                   f"{', '.join(sorted(kinds)) or 'none'}. Save the surface as triangles.")
    kept = [k for k, block in enumerate(mesh.cells) if block.dim == 2]
    cells = np.vstack([mesh.cells[k].data for k in kept]).astype(np.int64)
    points = np.zeros((len(mesh.points), 3))
    points[:, :mesh.points.shape[1]] = mesh.points
    nodes, cells = _merged(points * unit_m, cells)
    _check(path, nodes, cells)
    return TriangleMesh(path.name, nodes, cells, _groups(mesh, kept))


def _merged(points: Array, cells: Indices) -> tuple[Array, Indices]:
    """Nodes that the cells have, those at one place as one."""
    used, cells_of_used = np.unique(cells, return_inverse=True)
    cells = cells_of_used.reshape(cells.shape)
    place = points[used]
    step = _SAME * float(np.ptp(place, axis=0).max())
    _, first, number = np.unique(np.round(place / step), axis=0, return_index=True, return_inverse=True)
    return place[first], number.ravel()[cells]


def _check(path: Path, nodes: Array, cells: Indices) -> None:
    a, b, c = (nodes[cells[:, k]] for k in range(3))
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.sum((p - q) ** 2, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    flat = np.flatnonzero(~(twice > _FLAT * longest))
    if flat.size:
        raise InputFileError(path, f"{flat.size} of {len(cells)} triangles have no area, the first is number {flat[0]} "
                                   "(from 0); clean the mesh.")
    edges = np.sort(np.vstack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1)
    times = np.unique(edges, axis=0, return_counts=True)[1]
    if times.max() > 2:
        raise InputFileError(path, f"{int(np.sum(times > 2))} edges are shared by three triangles or more; a sheet has "
                                   "two at most. Clean the mesh.")


def _groups(mesh: Any, kept: list[int]) -> dict[str | int, Indices]:
    """Triangles by the number of their group, and by its name where the file has one."""
    out: dict[str | int, Indices] = {}
    label = next((name for name in _LABELS if name in mesh.cell_data), None)
    if label is not None:
        number = np.concatenate([np.ravel(mesh.cell_data[label][k]) for k in kept]).astype(np.int64)
        out |= {int(one): np.flatnonzero(number == one) for one in np.unique(number)}
        out |= {name: out[int(tag)] for name, (tag, dim) in mesh.field_data.items() if dim == 2 and int(tag) in out}
    start = np.cumsum([0, *(len(mesh.cells[k].data) for k in kept)])
    for name, parts in mesh.cell_sets.items():
        found = [start[i] + np.asarray(parts[k], dtype=np.int64) for i, k in enumerate(kept)
                 if parts[k] is not None and len(parts[k])]
        if found and not name.startswith("gmsh:"):
            out[name] = np.concatenate(found)
    return out
