"""Tables of quadrupoles, as geoelectrics has them: electrodes a, b, m, n, from 1, and a resistance a row, one frame.

BERT's unified data format (.ohm, .dat: a number of sensors, their places, a number of data, a line `#a b m n r`), R2's
protocol.dat (number of data, then number, a, b, m, n, resistance), and any table whose header names a, b, m, n and r.
Current flows from a to b; the reading is m less n, for 1 A.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.sensors.formats.layout import Layout, first_lines, frames, text_lines
from eitsim.sensors.recording import Recording
from touchcal.errors import InputFileError

_NAMES, _VALUES = ("a", "b", "m", "n"), ("r", "rho", "v", "u", "v/i", "u/i", "resistance")
_HEAD = 400  # lines among which the header of the table is looked for


@dataclass(frozen=True)
class _Table:
    """Where a table stands and which of its columns count."""

    first: int  # its first row, from 0
    rows: int | None  # how many it states; None for all
    columns: tuple[int, ...]  # of a, b, m, n and the value


def _cells(line: str) -> list[str]:
    return [cell for cell in re.split(r"[,;\s]+", line.strip().lstrip("#").strip()) if cell]


def _table(lines: Sequence[str]) -> _Table | None:
    for number, line in enumerate(lines):
        names = [re.sub(r"[(/\[].*", "", cell.lower()) for cell in _cells(line)]
        whole = [cell.lower() for cell in _cells(line)]
        value = [k for k, name in enumerate(whole) if name in _VALUES or names[k] in ("r", "resistance")]
        if set(_NAMES) <= set(names) and value:
            stated = re.match(r"\s*(\d+)\s*(#.*)?$", lines[number - 1]) if number else None
            return _Table(number + 1, int(stated.group(1)) if stated else None,
                          (*(names.index(name) for name in _NAMES), value[0]))
    held = [k for k, line in enumerate(lines) if line.strip()]
    if len(held) > 1 and re.fullmatch(r"\s*\d+\s*", lines[held[0]]) and _numbered(lines[held[1]]):
        return _Table(held[1], int(lines[held[0]]), (1, 2, 3, 4, 5))
    return None


def _numbered(line: str) -> bool:
    """Whether a line is the first of R2's: 1, four electrodes and one or two numbers."""
    cells = _cells(line)
    return len(cells) in (6, 7) and cells[0] == "1" and all(cell.isdecimal() for cell in cells[1:5])


def _is_table(path: Path) -> bool:
    return _table(first_lines(path, _HEAD)) is not None


def _read_table(path: Path, kind: str) -> Recording:
    lines = text_lines(path)
    table = _table(lines)
    assert table is not None
    held = [(number, cells) for number, line in enumerate(lines[table.first:], start=table.first + 1)
            if not line.lstrip().startswith("#") and (cells := _cells(line.split("#")[0]))]
    if table.rows is not None and len(held) < table.rows:
        raise InputFileError(path, f"{len(held)} rows of quadrupoles, and it states {table.rows}: it was cut. Copy it "
                                   "again.")
    found = [_row(path, number, cells, table.columns) for number, cells in held[:table.rows]]
    if not found:
        raise InputFileError(path, "a header of quadrupoles without rows. Give one row a reading: a, b, m, n, r.")
    values = np.array(found)
    return frames(path, values[:, 4][None], "voltage" if kind == "difference" else kind,
                  values[:, :4].astype(np.intp) - 1)


def _row(path: Path, number: int, cells: list[str], columns: tuple[int, ...]) -> list[float]:
    try:
        row = [float(cells[k]) for k in columns]
    except (IndexError, ValueError):
        raise InputFileError(path, f"expected electrodes a, b, m, n and a resistance, got '{' '.join(cells)[:40]}'.",
                             line=number) from None
    ends = row[:4]
    if any(end % 1 or end < 0 for end in ends):
        raise InputFileError(path, f"'{' '.join(cells)[:40]}' names no electrodes by whole numbers from 1.",
                             line=number)
    if min(ends) < 1:
        raise InputFileError(path, "electrode 0 stands for one that is far away, and all four must be on the body "
                                   "here. Leave the row out.", line=number)
    if ends[0] == ends[1] or ends[2] == ends[3]:
        raise InputFileError(path, "a and b, or m and n, are the same electrode. Correct or leave out the row.",
                             line=number)
    return row


FORMAT = Layout("tables of quadrupoles a, b, m, n, r (BERT .ohm, R2 .dat)", _is_table, _read_table)
