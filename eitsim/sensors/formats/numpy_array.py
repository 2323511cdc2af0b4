"""NumPy files: one array of frames, a row or a column each."""

from pathlib import Path

import numpy as np

from eitsim.sensors.formats.layout import Layout, a_row_a_frame, frames
from eitsim.sensors.recording import Recording
from touchcal.errors import InputFileError
from touchcal.input_file import regular


def _is_array(path: Path) -> bool:
    return path.suffix.lower() == ".npy"


def _read_array(path: Path, kind: str) -> Recording:
    try:
        array = np.load(regular(path), allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise InputFileError(path, f"not a NumPy array of numbers ({error}). Write it with numpy.save.") from None
    if array.dtype.kind not in "fciu" or array.ndim not in (1, 2):
        raise InputFileError(path, f"an array of {array.dtype} with {array.ndim} axes. Save numbers, one row a frame.")
    values = array.astype(np.complex128 if array.dtype.kind == "c" else float)
    return frames(path, a_row_a_frame(path, "the array", values), kind)


FORMAT = Layout("NumPy .npy with an array of frames", _is_array, _read_array)
