"""MATLAB files (v5 to v7): an array of frames, or EIDORS's data objects, whose meas has a column a frame."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.io.matlab import mat_struct

from eitsim.electrics.interop.eidors import mat_variables
from eitsim.sensors.conventions import counts_for
from eitsim.sensors.formats.layout import Layout, frames
from eitsim.sensors.recording import Recording
from touchcal.arrays import Array, Complex
from touchcal.errors import InputFileError

_FEWEST = 16  # readings of a frame where the other axis may be the readings too


def _is_matlab(path: Path) -> bool:
    return path.suffix.lower() == ".mat"


def _read_matlab(path: Path, kind: str) -> Recording:
    """The only array of the file, or the only data object; ValueError's words name those there are."""
    variables = mat_variables(path)
    found = {name: array for name, value in variables.items() if (array := _measured(value)) is not None}
    if len(found) != 1:
        raise InputFileError(path, f"{len(found)} arrays of readings{': ' if found else ''}{', '.join(found)}; it must "
                                   "hold one, of numbers, or one EIDORS data object with meas. Save that one alone.")
    (name, array), = found.items()
    if array.ndim == 1:
        return frames(path, array[None], kind)
    if isinstance(variables[name], mat_struct):
        return frames(path, array.T, kind)
    by_column, by_row = (size >= _FEWEST and bool(counts_for(size)) for size in array.shape)
    if by_column == by_row:
        raise InputFileError(path, f"{name} is {array.shape[0]} x {array.shape[1]}, and either may be the readings of "
                                   "a frame, or neither. Save it as a structure whose field meas has one column a "
                                   "frame, as EIDORS does, or as a CSV of one row a frame.")
    return frames(path, array.T if by_column else array, kind)


def _measured(value: Any) -> Array | Complex | None:
    """Readings of a variable, of an EIDORS data object a column a frame; None where it holds none."""
    if isinstance(value, mat_struct):
        value = getattr(value, "meas", None)
    array = np.asarray(value)
    if array.dtype.kind not in "fciu" or array.ndim not in (1, 2) or array.size < 2:
        return None
    return array.astype(np.complex128 if array.dtype.kind == "c" else float)


FORMAT = Layout("MATLAB .mat with an array of frames or EIDORS data", _is_matlab, _read_matlab)
