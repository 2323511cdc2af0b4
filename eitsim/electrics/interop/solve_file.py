"""A user's own model of a sheet on its own triangles, solved, what the triangles cost, and the document of
`eitsim solve-mesh`."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eitsim.electrics.cem.assembly import Array, SkinMesh, impedance
from eitsim.electrics.interop.eidors import Model, read_eidors
from eitsim.electrics.mesh.p2_triangles import sides
from eitsim.scene.drive import Drive, Protocol, protocol, readings
from touchcal.errors import InputFileError
from touchcal.jit import cpu_s
from touchcal.provenance import versions
from touchcal.toml_file import read_toml

ELEMENTS = ("P1", "P2")


@dataclass(frozen=True, eq=False)
class Solved:
    """A model, solved."""

    impedance_Ohm: Array  # (electrodes, electrodes) impedance matrix, Ohm; rows and columns sum to zero
    readings_V: tuple[Array, ...]  # one (patterns, readings) a protocol, V
    # relative difference of linear and quadratic elements on the same triangles, 2-norms: of the impedance matrix, and
    # of all readings; None without any
    impedance_error: float
    readings_error: float | None
    unknowns: int  # unknowns of the linear system
    cpu_s: float  # CPU time spent, s


def solve_model(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance_Ohm_m: ArrayLike,
                protocols: Sequence[Protocol] = (), *, element: str = "P1") -> Solved:
    """Solve linear triangles as they are ("P1", as EIDORS does) or with middle nodes on their straight edges ("P2").

    Conductance: one number, S, or (cells,), or (cells, 2, 2) tensors; contact impedance one number or (electrodes,).
    The errors are the difference between both elements: close to that of P1, well above that of P2 but for a
    curved rim, whose straight edges neither knows. ValueError for another element or mesh, and as in `cem.impedance`.
    """
    start = cpu_s()
    check_element(element)
    if mesh.element != "P1":
        raise ValueError(f"a mesh of {mesh.element} elements; give one of linear triangles, P1.")
    given = np.asarray(conductance_S, dtype=float)
    given = given[:, None] if given.ndim > 1 else np.broadcast_to(given, len(mesh.cells))
    meshes = {"P1": mesh, "P2": quadratic(mesh)}
    solved = {name: impedance(m, given, contact_impedance_Ohm_m) for name, m in meshes.items()}
    read = {name: tuple(readings(asked, z) for asked in protocols) for name, z in solved.items()}
    flat = {name: np.concatenate([np.ravel(part) for part in parts]) if parts else None for name, parts in read.items()}
    of_readings = None if flat["P1"] is None or flat["P2"] is None else _difference(flat["P1"], flat["P2"])
    return Solved(solved[element], read[element], _difference(solved["P1"], solved["P2"]), of_readings,
                  len(meshes[element].nodes_m) + mesh.count - 1, cpu_s() - start)


def solve_sheet_model(model: Model | Path | str, *, variable: str | None = None, conductance_S: float | None = None,
                      drive: Drive | None = None, element: str = "P1") -> Solved:
    """Impedance matrix and readings of an EIDORS model of a sheet, with what its triangles cost of them.

    Parameters
    ----------
    model
        A MATLAB file (v5 to v7) of a fwd_model, an image or an inv_model, or what `read_eidors` made of it.
    variable
        Name of the model in the file, where there are several.
    conductance_S
        One sheet conductance, S, in place of the image's elem_data.
    drive
        Takes the place of the model's stimulation.
    element
        "P1" solves what EIDORS solves; "P2" puts quadratic elements on the same triangles.

    Returns
    -------
    Solved
        `impedance_Ohm` (electrodes x electrodes), `readings_V` (an array of patterns x readings for each stimulation),
        and relative errors of both.

    Raises
    ------
    InputFileError
        Where the file holds no model of a sheet, or conductances that are not positive.
    ValueError
        Where neither the model nor an argument gives the conductance, and for an unknown element.

    Examples
    --------
    >>> import eitsim
    >>> eitsim.solve_sheet_model("absent.mat")
    Traceback (most recent call last):
    touchcal.errors.InputFileError: absent.mat: no such file. Check the name and the folder.
    """
    check_element(element)
    if conductance_S is not None:
        check_conductance(conductance_S, "conductance_S")
    model = model if isinstance(model, Model) else read_eidors(model, variable)
    protocols = model.stimulation if drive is None else (protocol(drive, model.mesh.count),)
    return solve_model(model.mesh, _conductance(model, conductance_S), model.contact_impedance_Ohm_m, protocols,
                       element=element)


def solved_document(path: Path, model: Model, conductance_S: float | None, element: str,
                    solved: Solved) -> dict[str, Any]:
    """A solved model as plain JSON values, units in the names of the keys. `readings_V` has a row a pattern; rows may
    differ in length."""
    errors = {"impedance": solved.impedance_error, "readings": solved.readings_error}
    conductance = _conductance(model, conductance_S)
    value = np.linalg.eigvalsh(conductance) if np.ndim(conductance) > 1 else np.asarray(conductance)
    return {"schema": 1,
            "model": {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
                      "variable": model.name, "electrodes": model.mesh.count,
                      "nodes": len(model.mesh.nodes_m), "triangles": len(model.mesh.cells), "element": element,
                      "conductance_S": [float(np.min(value)), float(np.max(value))],
                      "contact_impedance_Ohm_m": model.contact_impedance_Ohm_m.tolist()},
            "impedance_Ohm": solved.impedance_Ohm.tolist(),
            "readings_V": [row for part in solved.readings_V for row in part.tolist()],
            "error_estimate": {key: error for key, error in errors.items() if error is not None},
            "cost": {"cpu_s": solved.cpu_s, "unknowns": solved.unknowns}, "versions": versions()}


def _conductance(model: Model, given_S: float | None) -> Array | float:
    """The sheet conductances that a model is solved with, S; InputFileError names the first that is not positive."""
    if given_S is not None:
        return given_S
    if model.conductance_S is None:
        raise InputFileError(model.file, f"'{model.name}' holds no elem_data; give one sheet conductance with "
                                         "--conductance-S, or save the image.")
    least = model.conductance_S if model.conductance_S.ndim == 1 else np.linalg.eigvalsh(model.conductance_S)[:, 0]
    wrong = np.flatnonzero(~((least > 0) & np.isfinite(least)))
    if wrong.size:
        raise InputFileError(model.file, f"elem_data of triangle {wrong[0] + 1} is {least[wrong[0]]:g} S; sheet "
                                         "conductances must be positive and finite. Fix it, or give one value with "
                                         "--conductance-S.")
    return model.conductance_S


def check_conductance(conductance_S: float, where: str) -> None:
    """ValueError, which names where it was given, for a sheet conductance that is not positive and finite."""
    if not 0 < conductance_S < math.inf:
        raise ValueError(f"{where} must be a positive, finite sheet conductance, S, got {conductance_S:g}.")


def unused_tables(scene: Path) -> list[str]:
    """Tables and keys of a scene file that solve-mesh does not use, as they are written there."""
    return [f"[{key}]" if isinstance(value, dict | list) else key for key, value in read_toml(scene).items()
            if key != "drive"]


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


def _difference(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))
