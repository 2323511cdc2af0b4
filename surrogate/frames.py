"""Recorded frames of voltages: a CSV of one column a reading, one row a frame, header optional."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.dataset import voltage_columns
from matcal.errors import TestFileError

Array = NDArray[np.float64]

# A reading this far below the RMS of its frame is a dead channel.
DEAD = 1e-9


@dataclass(frozen=True)
class Frames:
    """Frames and where they stand in their file."""

    # (n, readings) V
    volts: Array
    # (n,) line numbers from 1
    line: NDArray[np.int64]


def read_frames(path: Path, readings: int) -> Frames:
    """Read a file of frames; TestFileError names the line of a wrong width, a missing number or a dead channel."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = [(number, [cell.strip() for cell in cells]) for number, cells in enumerate(csv.reader(file), start=1)
                    if any(cell.strip() for cell in cells)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise TestFileError(path, f"not a text file of frames ({error}). Expected a CSV of voltages.") from None
    order = np.arange(readings)
    if rows and not _is_number(rows[0][1][0]):
        order = _order(path, rows[0], readings)
        rows = rows[1:]
    if not rows:
        raise TestFileError(path, f"it holds no frames. A frame is a row of {readings} voltages.")
    volts = np.array([_numbers(path, number, cells, readings) for number, cells in rows])
    lines = np.array([number for number, _ in rows], np.int64)
    _refuse_dead(path, volts, lines)
    return Frames(volts[:, order], lines)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _order(path: Path, header: tuple[int, list[str]], readings: int) -> NDArray[np.intp]:
    """Positions of the readings v_000 ... in the header; the file's own order where it names them otherwise."""
    number, names = header
    _check_width(path, number, names, readings)
    wanted = voltage_columns(readings)
    if set(wanted) == set(names):
        return np.array([names.index(name) for name in wanted])
    return np.arange(readings)


def _check_width(path: Path, number: int, cells: list[str], readings: int) -> None:
    if len(cells) != readings:
        raise TestFileError(path, f"{len(cells)} columns; the model reads {readings} voltages a frame.", line=number)


def _numbers(path: Path, number: int, cells: list[str], readings: int) -> list[float]:
    _check_width(path, number, cells, readings)
    values = []
    for column, cell in enumerate(cells, start=1):
        value = float(cell) if _is_number(cell) else np.nan
        if not np.isfinite(value):
            raise TestFileError(path, f"column {column} holds '{cell}', not a voltage. Leave the frame out or mend it.",
                                line=number)
        values.append(value)
    return values


def _refuse_dead(path: Path, volts: Array, lines: NDArray[np.int64]) -> None:
    """A dead channel reads nothing in a frame, or exactly the same in every frame while nine in ten others change."""
    size = np.sqrt(np.mean(volts**2, axis=1, keepdims=True))
    silent = np.argwhere(np.abs(volts) <= DEAD * size)
    if len(silent):
        frame, column = silent[0]
        raise TestFileError(path, f"column {column + 1} reads {volts[frame, column]:g} V: a dead channel. Mend it; a "
                                  "model trained on all readings cannot do without it.", line=int(lines[frame]))
    stuck = np.ptp(volts, axis=0) == 0
    if len(volts) > 2 and 0 < np.mean(stuck) < 0.1:
        column = int(np.argmax(stuck))
        raise TestFileError(path, f"column {column + 1} reads exactly {volts[0, column]:g} V from this line on, in all "
                                  f"{len(volts)} frames: a dead channel.", line=int(lines[0]))
