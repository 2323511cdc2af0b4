"""Goe-MF's .get files: 256 numbers of four bytes a frame, one frame after the other, without a header.

A frame is 16 adjacent currents of 16 neighbours' voltages each; those of driven electrodes are 0. Layout as EIDORS
reads files of this name.
"""

from pathlib import Path

import numpy as np

from eitsim.sensors.formats.layout import Layout, frames
from eitsim.sensors.recording import Recording
from touchcal.errors import InputFileError
from touchcal.input_file import regular

_READINGS, _BYTES = 256, 4


def _is_get(path: Path) -> bool:
    return path.suffix.lower() == ".get" and path.is_file()


def _read_get(path: Path, kind: str) -> Recording:
    raw = regular(path).read_bytes()
    if not raw or len(raw) % (_READINGS * _BYTES):
        raise InputFileError(path, f"{len(raw)} bytes, and frames of {_READINGS} numbers of {_BYTES} bytes make a "
                                   f"multiple of {_READINGS * _BYTES}: it was cut, or is a .get file of another "
                                   "instrument. Copy it again, or save its frames as a CSV of one row a frame.")
    values = np.frombuffer(raw, dtype="<f4").reshape(-1, _READINGS).astype(float)
    if not np.isfinite(values).all() or np.abs(values).max() > 1e30:
        raise InputFileError(path, "not numbers of four bytes, as Goe-MF writes them: a .get file of another "
                                   "instrument. Save its frames as a CSV of one row a frame.")
    return frames(path, values, kind)


FORMAT = Layout("Goe-MF .get, 256 numbers a frame", _is_get, _read_get)
