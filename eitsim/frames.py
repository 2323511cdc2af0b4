"""Frames of voltages as a CSV: one column a reading, pattern-major, one row a frame, header optional."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.dataset import voltage_columns
from eitsim.number_table import read_numbers, write_numbers
from eitsim.results import Readings
from matcal.errors import TestFileError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Frames:
    """Frames and where they stand in their file."""

    # (n, readings) V
    volts: Array
    # (n,) line numbers from 1
    line: NDArray[np.int64]


def read_frames(path: Path | str, readings: int, unread: NDArray[np.bool_] | None = None) -> Frames:
    """Read a file of frames, columns v_000 ... in any order where a header names them, else in the file's own.

    Readings of the mask `unread` (readings,), which need a missing electrode, may be empty and are 0. TestFileError
    names the line of a wrong width or a missing number.
    """
    table = read_numbers(path, readings, what="voltages", blanks=unread is not None)
    volts, wanted = table.values, voltage_columns(readings)
    if set(wanted) == set(table.names):
        volts = volts[:, [table.names.index(name) for name in wanted]]
    if unread is not None:
        empty = np.argwhere(np.isnan(volts) & ~unread)
        if len(empty):
            raise TestFileError(path, f"{wanted[empty[0, 1]]} is empty, and its electrodes are all there. Mend it, or "
                                      "name what is missing in [electrodes].", line=int(table.line[empty[0, 0]]))
        volts = np.where(unread, 0.0, volts)
    return Frames(volts, table.line)


def write_frames(path: Path | str, frames: Sequence[Readings]) -> None:
    """Write solved readings as frames that `read_frames` and `surrogate predict` read: the untouched one first, then
    one a solution, columns v_000 ... in the order of the drive pattern, V, empty where an electrode is missing."""
    volts = np.array([frames[0].baseline_V.ravel(), *(frame.touched_V.ravel() for frame in frames)])
    write_numbers(path, voltage_columns(volts.shape[1]), volts)
