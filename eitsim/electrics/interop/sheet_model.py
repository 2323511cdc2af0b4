"""A user's own model of a sheet on its own triangles: impedance matrix, readings, and what the triangles cost."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.electrics.cem.assembly import SkinMesh, impedance, quadrature_points
from eitsim.scene.drive import Protocol, readings

Array = NDArray[np.float64]
Indices = NDArray[np.integer]

ELEMENTS = ("P1", "P2")


@dataclass(frozen=True, eq=False)
class Solved:
    """A model, solved."""

    # (electrodes, electrodes) impedance matrix, Ohm; rows and columns sum to zero
    impedance_Ohm: Array
    # one (patterns, readings) a protocol, V
    readings_V: tuple[Array, ...]
    # relative difference of linear and quadratic elements on the same triangles, 2-norms: of the impedance matrix, and
    # of all readings; None without any
    impedance_error: float
    readings_error: float | None
    # unknowns of the linear system
    unknowns: int
    # CPU time spent, s
    cpu_s: float


def solve_model(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance_Ohm_m: ArrayLike,
                protocols: Sequence[Protocol] = (), *, element: str = "P1") -> Solved:
    """Solve linear triangles as they are ("P1", as EIDORS does) or with middle nodes on their straight edges ("P2").

    Conductance: one number, S, or (cells,), or (cells, 2, 2) tensors; contact impedance one number or (electrodes,).
    The errors told are the difference between both elements: close to that of P1, well above that of P2 but for a
    curved rim, whose straight edges neither knows. ValueError for another element or mesh, and as in `cem.impedance`.
    """
    start = time.process_time()
    check_element(element)
    if mesh.element != "P1":
        raise ValueError(f"a mesh of {mesh.element} elements; give one of linear triangles, P1.")
    given = np.broadcast_to(np.asarray(conductance_S, dtype=float), _shape(conductance_S, mesh))
    meshes = {"P1": mesh, "P2": quadratic(mesh)}
    solved = {name: impedance(m, _at_points(m, given), contact_impedance_Ohm_m) for name, m in meshes.items()}
    read = {name: tuple(readings(asked, z) for asked in protocols) for name, z in solved.items()}
    flat = {name: np.concatenate([np.ravel(part) for part in parts]) if parts else None for name, parts in read.items()}
    of_readings = None if flat["P1"] is None or flat["P2"] is None else _apart(flat["P1"], flat["P2"])
    return Solved(solved[element], read[element], _apart(solved["P1"], solved["P2"]), of_readings,
                  len(meshes[element].nodes_m) + mesh.count - 1, time.process_time() - start)


def check_element(element: str) -> None:
    """ValueError for an element that is not built."""
    if element not in ELEMENTS:
        raise ValueError(f"element '{element}' is unknown; known: {', '.join(ELEMENTS)}.")


def quadratic(mesh: SkinMesh) -> SkinMesh:
    """The same straight triangles with middle nodes (P1 to P2)."""
    edges, number = np.unique(sides(mesh.cells), axis=0, return_inverse=True)
    size = len(mesh.nodes_m)
    under = np.sort(mesh.under, axis=1) @ [size, 1]
    along = np.minimum(np.searchsorted(edges @ [size, 1], under), len(edges) - 1)
    if np.any((edges @ [size, 1])[along] != under):
        raise ValueError("an electrode lies on an edge of no triangle; name edges of the mesh.")
    return replace(mesh, nodes_m=np.vstack([mesh.nodes_m, mesh.nodes_m[edges].mean(axis=1)]), element="P2",
                   cells=np.column_stack([mesh.cells, size + number.reshape(3, -1).T]),
                   under=np.column_stack([mesh.under, size + along]))


def sides(cells: Indices) -> Indices:
    """Sides (3 cells, 2) of triangles, lower number first: those from corner 0 to 1, then 1 to 2, then 0 to 2."""
    return np.sort(np.vstack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1)


def _shape(conductance_S: ArrayLike, mesh: SkinMesh) -> tuple[int, ...]:
    tensor = np.ndim(conductance_S) > 1
    return (len(mesh.cells), 2, 2) if tensor else (len(mesh.cells),)


def _at_points(mesh: SkinMesh, conductance: Array) -> Array:
    """Conductance of elements at their quadrature points, where it is a tensor."""
    if conductance.ndim == 1:
        return conductance
    points = quadrature_points(mesh).shape[1]
    return np.repeat(conductance[:, None], points, axis=1)


def _apart(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))
