"""A model of the user's own, solved, and the document that `eitsim solve-mesh` writes of it."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.interop.eidors import Model, read_eidors
from eitsim.electrics.interop.sheet_model import Solved, check_element, solve_model
from eitsim.scene.drive import Drive, protocol
from touchcal.errors import InputFileError
from touchcal.provenance import versions
from touchcal.toml_file import read_toml


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
        Where neither the model nor an argument tells the conductance, and for an unknown element.

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


def _conductance(model: Model, given_S: float | None) -> NDArray[np.float64] | float:
    """The sheet conductances that a model is solved with, S."""
    if given_S is not None:
        return given_S
    if model.conductance_S is None:
        raise InputFileError(model.file, f"'{model.name}' holds no elem_data; give one sheet conductance with "
                                         "--conductance-S, or save the image.")
    _check_elements(model.file, model.conductance_S)
    return model.conductance_S


def check_conductance(conductance_S: float, where: str) -> None:
    """ValueError, which names where it was given, for a sheet conductance that is not positive and finite."""
    if not 0 < conductance_S < math.inf:
        raise ValueError(f"{where} must be a positive, finite sheet conductance, S, got {conductance_S:g}.")


def unused_tables(scene: Path) -> list[str]:
    """Tables and keys of a scene file that solve-mesh does not use, as they are written there."""
    return [f"[{key}]" if isinstance(value, dict | list) else key for key, value in read_toml(scene).items()
            if key != "drive"]


def _check_elements(path: Path, conductance_S: NDArray[np.float64]) -> None:
    """InputFileError names the first triangle whose elem_data is not positive."""
    least = conductance_S if conductance_S.ndim == 1 else np.linalg.eigvalsh(conductance_S)[:, 0]
    wrong = np.flatnonzero(~((least > 0) & np.isfinite(least)))
    if wrong.size:
        raise InputFileError(path, f"elem_data of triangle {wrong[0] + 1} is {least[wrong[0]]:g} S; sheet conductances "
                                   "must be positive and finite. Mend it, or give one value with --conductance-S.")
