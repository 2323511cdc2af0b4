"""MATLAB files (v5 to v7): an array of frames, or EIDORS's data objects, whose meas has a column a frame."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.io.matlab import mat_struct

from eitsim.electrics.interop.eidors import mat_variables
from eitsim.sensors.formats.layout import Layout, a_row_a_frame, frames
from eitsim.sensors.formats.stimulations import stated_pairs
from eitsim.sensors.recording import Recording
from touchcal.arrays import Array, Complex
from touchcal.errors import InputFileError

_PAIR = ("vh", "vi")  # EIDORS's names of the untouched (homogeneous) and the touched (inhomogeneous) data


def _is_matlab(path: Path) -> bool:
    return path.suffix.lower() == ".mat"


def _read_matlab(path: Path, kind: str) -> Recording:
    """The only array or data object of the file, or its vh, untouched, and then its vi, touches 1, 2, ...;
    InputFileError names what else there is."""
    variables = mat_variables(path)
    pairs = stated_pairs(variables)
    known = None if pairs is None else len(pairs)
    found = {name: array for name, value in variables.items() if (array := _measured(value)) is not None
             and (known is None or known in array.shape)}
    if set(_PAIR) <= set(found):
        known = known or _of_one_frame(found[_PAIR[0]], found[_PAIR[1]])
        untouched, touched = (_frames(path, name, variables[name], found[name], known) for name in _PAIR)
        if untouched.shape[1] != touched.shape[1]:
            raise InputFileError(path, f"vh has {untouched.shape[1]} readings a frame, and vi {touched.shape[1]}. Save "
                                       "both of one stimulation.")
        names = [""] * len(untouched) + [str(number) for number in range(1, len(touched) + 1)]
        both = np.array([*untouched, *touched])
        return Recording(both, np.arange(len(both)), None, np.array(names), kind, path, pairs)
    if len(found) != 1:
        held = ", ".join(found) or "; ".join(f"{name} is {_described(value)}" for name, value in variables.items())
        raise InputFileError(path, f"{len(found)} arrays of readings{': ' if held else ''}{held}. It must hold one, of "
                                   "numbers with one row or one column a frame, or one EIDORS data object with meas, "
                                   "or two as vh (untouched) and vi (touched). Save these alone, with the structure of "
                                   "stimulations where there is one.")
    (name, array), = found.items()
    return frames(path, _frames(path, name, variables[name], array, known), kind, pairs)


def _of_one_frame(untouched: Array | Complex, touched: Array | Complex) -> int | None:
    """How many readings a frame has where untouched data are one frame: a vector, or a row or column as long as one
    axis of the touched data alone."""
    size = untouched.size
    return size if max(untouched.shape) == size and (touched.ndim == 1 or touched.shape.count(size) == 1) else None


def _frames(path: Path, name: str, value: Any, array: Array | Complex, readings: int | None) -> Array | Complex:
    """(frames, readings) of a variable."""
    if not isinstance(value, mat_struct):
        return a_row_a_frame(path, name, array, readings)
    return array[None] if array.ndim == 1 else array.T


def _measured(value: Any) -> Array | Complex | None:
    """Readings of a variable, of an EIDORS data object a column a frame; None where it holds none."""
    if isinstance(value, mat_struct):
        value = getattr(value, "meas", None)
    array = np.asarray(value)
    if array.dtype.kind not in "fciu" or array.ndim not in (1, 2) or array.size < 2:
        return None
    return array.astype(np.complex128 if array.dtype.kind == "c" else float)


def _described(value: Any) -> str:
    """What a variable without readings is."""
    if isinstance(value, mat_struct):
        return "a structure without meas"
    return " x ".join(map(str, np.shape(value))) or "one value"


FORMAT = Layout("MATLAB .mat with an array of frames or EIDORS data", _is_matlab, _read_matlab)
