"""Triangles in space from files that meshio reads, checked to be a sheet."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from eitsim.scene.mesh_file import read_mesh
from touchcal.arrays import Array
from touchcal.errors import InputFileError

Indices = NDArray[np.int64]

_SAME = 1e-6  # Nodes nearer to each other than this part of the sheet's size are one.
_NEAR = 1e-2  # Least gap between open edges over their length.
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
        raise InputFileError(path, "no such file. Check the name, which is relative to the file that names it.")
    try:
        mesh = read_mesh(path)
    except (ValueError, OSError) as error:
        raise InputFileError(path, f"no mesh that meshio reads ({error}).") from None
    kinds = {block.type for block in mesh.cells if block.dim == 2}
    if not kinds or not kinds <= {"triangle", "triangle6"} or len(kinds) > 1:
        raise InputFileError(path, "a sheet of triangles is solved, linear or quadratic ones, not both; got "
                                   f"{', '.join(sorted(kinds)) or 'none'}. Save the surface as triangles.")
    kept = [k for k, block in enumerate(mesh.cells) if block.dim == 2]
    cells = np.vstack([mesh.cells[k].data for k in kept]).astype(np.int64)
    points = np.zeros((len(mesh.points), 3))
    points[:, :mesh.points.shape[1]] = mesh.points
    missing = cells[(cells < 0) | (cells >= len(points))]
    if missing.size:
        raise InputFileError(path, f"a triangle has node {missing[0]} (from 0), which it does not have.")
    bad = np.intersect1d(cells, np.flatnonzero(~np.isfinite(points).all(axis=1)))
    if bad.size:
        raise InputFileError(path, f"node {bad[0]} (from 0) is not finite: {points[bad[0]].tolist()}; clean the mesh.")
    nodes, cells = _merged(points * unit_m, cells)
    _check(path, nodes, cells)
    return TriangleMesh(path.name, nodes, cells, _groups(path, mesh, kept))


def _merged(points: Array, cells: Indices) -> tuple[Array, Indices]:
    """Nodes that the cells have, those at one place as one."""
    used, cells_of_used = np.unique(cells, return_inverse=True)
    place, number = np.unique(points[used], axis=0, return_inverse=True)
    pairs = KDTree(place).query_pairs(_SAME * float(np.ptp(place, axis=0).max()), output_type="ndarray")
    near = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(place), len(place)))
    _, one = connected_components(near, directed=False)
    _, first = np.unique(one, return_index=True)
    return place[first], one.astype(np.int64)[number.ravel()[cells_of_used.reshape(cells.shape)]]


def _check(path: Path, nodes: Array, cells: Indices) -> None:
    a, b, c = (nodes[cells[:, k]] for k in range(3))
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.sum((p - q) ** 2, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    flat = np.flatnonzero(~(twice > _FLAT * longest))
    if flat.size:
        raise InputFileError(path, f"{flat.size} of {len(cells)} triangles have no area, the first is number {flat[0]} "
                                   "(from 0); clean the mesh.")
    edges = np.sort(np.vstack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1)
    found, first, times = np.unique(edges, axis=0, return_index=True, return_counts=True)
    if times.max() > 2:
        raise InputFileError(path, f"{int(np.sum(times > 2))} edges are shared by three triangles or more; a sheet has "
                                   "two at most. Clean the mesh.")
    opposite = cells[:, [2, 0, 1]].T.ravel()[first]
    at, gap = _gaps(nodes, found, times == 1, opposite)
    if len(at):
        places = " and ".join(f"({', '.join(f'{1e3 * x:.6g}' for x in nodes[one])})" for one in at[:2])
        raise InputFileError(path, f"{len(at)} nodes on open edges nearly touch another open edge, at {places} mm, "
                                   f"{1e3 * gap[0]:.2g} mm from it: the sheet would be solved with a slit there. Weld "
                                   "the mesh (merge nodes by distance, and cut edges at nodes that lie on them), or "
                                   "where a slit is meant give it edges shorter than 100 times its width.")


def _gaps(nodes: Array, edges: Indices, is_open: NDArray[np.bool_], opposite: Indices) -> tuple[Indices, Array]:
    """Nodes on open edges that lie within _NEAR of the length of another open edge and of their own from it, and how
    far, m; opposite: (edges,) third corner of a triangle at each edge. Nodes that a triangle's edge joins are none."""
    a, b = edges[is_open].T
    if not len(a):
        return a, np.zeros(0)
    length = np.linalg.norm(nodes[b] - nodes[a], axis=1)
    shortest = np.full(len(nodes), np.inf)
    np.minimum.at(shortest, np.concatenate([a, b]), np.tile(length, 2))
    on = np.unique([a, b])
    around = KDTree(nodes[on]).query_ball_point((nodes[a] + nodes[b]) / 2, (0.5 + _NEAR) * length)
    e = np.repeat(np.arange(len(a)), [len(one) for one in around])
    n = on[np.concatenate(around).astype(np.int64)]
    side, off = nodes[b[e]] - nodes[a[e]], nodes[n] - nodes[a[e]]
    along = np.clip(np.sum(side * off, axis=1) / length[e] ** 2, 0, 1)
    gap = np.linalg.norm(off - along[:, None] * side, axis=1)
    end = np.where(along < 0.5, a[e], b[e])
    joined = np.isin(np.minimum(n, end) * len(nodes) + np.maximum(n, end), edges @ [len(nodes), 1])
    joined &= np.linalg.norm(nodes[n] - nodes[end], axis=1) < _NEAR * length[e]
    near = ((gap < _NEAR * np.minimum(length[e], shortest[n])) & ~joined & (n != a[e]) & (n != b[e])
            & (n != opposite[is_open][e]))
    at, which = np.unique(n[near], return_index=True)
    return at, gap[near][which]


def _groups(path: Path, mesh: Any, kept: list[int]) -> dict[str | int, Indices]:
    """Triangles by the number of their group, and by its name where the file has one."""
    out: dict[str | int, Indices] = {}
    label = next((name for name in _LABELS if name in mesh.cell_data), None)
    if label is not None:
        data = np.concatenate([np.asarray(mesh.cell_data[label][k]) for k in kept])
        if data.size != len(data) or not np.array_equal(data, np.round(data)):
            raise InputFileError(path, f"{label!r} must hold one whole number a triangle, that of its group.")
        number = data.ravel().astype(np.int64)
        out |= {int(one): np.flatnonzero(number == one) for one in np.unique(number)}
        out |= {name: out[int(tag)] for name, (tag, dim) in mesh.field_data.items() if dim == 2 and int(tag) in out}
    start = np.cumsum([0, *(len(mesh.cells[k].data) for k in kept)])
    for name, parts in mesh.cell_sets.items():
        found = [start[i] + np.asarray(parts[k], dtype=np.int64) for i, k in enumerate(kept)
                 if parts[k] is not None and len(parts[k])]
        if found and not name.startswith("gmsh:"):
            out[name] = np.concatenate(found)
    return out
