"""A model file of the user's own, solved into the document that `eitsim solve-mesh` writes."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.interop.eidors import read_eidors
from eitsim.electrics.interop.sheet_model import solve_model
from eitsim.scene.drive import Drive, protocol
from touchcal.errors import TestFileError
from touchcal.provenance import versions
from touchcal.toml_file import read_toml


def solve_file(path: Path, variable: str | None = None, conductance_S: float | None = None, drive: Drive | None = None,
               element: str = "P1") -> dict[str, Any]:
    """Impedance matrix and readings of an EIDORS model as plain JSON values, units in the names of the keys.

    conductance_S stands for the image's own elem_data, drive for the model's own stimulation. `readings_V` has a row a
    pattern; rows may differ in length. ValueError where neither file nor argument tells the conductance.
    """
    model = read_eidors(path, variable)
    if model.conductance_S is not None and conductance_S is None:
        _check_elements(path, model.conductance_S)
    conductance = model.conductance_S if conductance_S is None else conductance_S
    if conductance is None:
        raise TestFileError(path, f"'{model.name}' holds no elem_data; give one sheet conductance with "
                                  "--conductance-S, or save the image.")
    protocols = model.stimulation if drive is None else (protocol(drive, model.mesh.count),)
    solved = solve_model(model.mesh, conductance, model.contact_impedance_Ohm_m, protocols, element=element)
    errors = {"impedance": solved.impedance_error, "readings": solved.readings_error}
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


def check_conductance(conductance_S: float, where: str) -> None:
    """ValueError, which names where it was given, for a sheet conductance that is not positive and finite."""
    if not 0 < conductance_S < math.inf:
        raise ValueError(f"{where} must be a positive, finite sheet conductance, S, got {conductance_S:g}.")


def unused_tables(scene: Path) -> list[str]:
    """Tables and keys of a scene file that solve-mesh does not use, as they are written there."""
    return [f"[{key}]" if isinstance(value, dict | list) else key for key, value in read_toml(scene).items()
            if key != "drive"]


def _check_elements(path: Path, conductance_S: NDArray[np.float64]) -> None:
    """TestFileError names the first triangle whose elem_data is not positive."""
    least = conductance_S if conductance_S.ndim == 1 else np.linalg.eigvalsh(conductance_S)[:, 0]
    wrong = np.flatnonzero(~((least > 0) & np.isfinite(least)))
    if wrong.size:
        raise TestFileError(path, f"elem_data of triangle {wrong[0] + 1} is {least[wrong[0]]:g} S; sheet conductances "
                                  "must be positive and finite. Mend it, or give one value with --conductance-S.")
