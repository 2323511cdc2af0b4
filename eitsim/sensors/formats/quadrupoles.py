"""Tables of quadrupoles, as geoelectrics has them: electrodes a, b, m, n, from 1, and a resistance a row, one frame.

BERT's unified data format (.ohm, .dat: a number of sensors, their places, a number of data, a line `#a b m n r`), R2's
protocol.dat (number of data, then number, a, b, m, n, resistance), and any table whose header names a, b, m, n (or c1,
c2, p1, p2) and r. Current flows from a to b; the reading is m less n, for 1 A: over the current where it has a column.
A list that is repeated is several frames. Electrodes count from 0 where electrode 0 stands in all four columns, as none
that is far away does.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.sensors.formats.layout import Layout, first_lines, frames, text_lines
from eitsim.sensors.recording import Recording
from touchcal.arrays import Index
from touchcal.errors import InputFileError

_NAMES, _ALSO = ("a", "b", "m", "n"), ("c1", "c2", "p1", "p2")
_RATIOS, _VOLTAGES, _CURRENTS = ("r", "v/i", "u/i", "resistance"), ("v", "u", "voltage"), ("i", "current")
_APPARENT = ("rho", "rhoa", "rho_a", "app_res", "ρa")  # a resistance times a factor of the layout
_PREFIXES = {"u": 1e-6, "µ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6}
_HEAD = 400  # lines among which the header of the table is looked for


@dataclass(frozen=True)
class _Table:
    """Where a table stands and which of its columns count."""

    first: int  # its first row, from 0
    rows: int | None  # how many it states; None for all
    columns: tuple[int, ...]  # of a, b, m, n and the value; then of its current, where that has one
    unit: float  # of the value, over that of its current, in SI
    width: int | None = None  # cells that its header names; None without one
    apparent: bool = False  # whether the value is an apparent resistivity, and the last column its factor


def _cells(line: str) -> list[str]:
    """The cells of a line; a comma between digits is a decimal mark where other marks stand between cells."""
    text = line.strip().lstrip("#").strip()
    if re.search(r"[;\t]", text):
        text = re.sub(r"(?<=\d),(?=\d)", ".", text)
    return [cell for cell in re.split(r"[,;\s]+", text) if cell]


def _table(lines: Sequence[str]) -> _Table | None:
    for number, line in enumerate(lines):
        cells = _cells(re.sub(r"\s+(?=[(\[])", "", line))
        whole = [dict(zip(_ALSO, _NAMES, strict=True)).get(cell.lower(), cell.lower()) for cell in cells]
        names = [name if name in _RATIOS else re.sub(r"[(/\[].*", "", name) for name in whole]
        value = [names.index(name) for name in (*_RATIOS, *_VOLTAGES, *_APPARENT) if name in names]
        if set(_NAMES) <= set(names) and value:
            stated = re.match(r"\s*(\d+)\s*(#.*)?$", lines[number - 1]) if number else None
            apparent = names[value[0]] in _APPARENT
            over_it = ("k",) if apparent else _CURRENTS if names[value[0]] in _VOLTAGES else ()
            current = [names.index(name) for name in over_it if name in names]
            found = (*(names.index(name) for name in _NAMES), value[0], *current[:1])
            size, *over = (_unit(cells[k]) for k in found[4:])
            return _Table(number + 1, int(stated.group(1)) if stated else None, found, size / (over or [1.0])[0],
                          len(cells), apparent)
    held = [k for k, line in enumerate(lines) if line.strip()]
    if len(held) > 1 and re.fullmatch(r"\s*\d+\s*", lines[held[0]]) and _numbered(lines[held[1]]):
        return _Table(held[1], int(lines[held[0]]), (1, 2, 3, 4, 5), 1.0)
    return None


def _unit(name: str) -> float:
    """The unit behind a name, in SI, by its prefix."""
    found = re.search(r"[(/\[]([uµmkM])(?:[VA]|Ohm|ohm|Ω)", name)
    return _PREFIXES[found.group(1)] if found else 1.0


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
    if table.apparent and len(table.columns) < 6:
        raise InputFileError(path, "it holds an apparent resistivity, the resistance times a factor of the layout. "
                                   "Give the resistance as a column r, or the factor as a column k.", line=table.first)
    wide = next((row for row in held[:table.rows] if table.width and len(row[1]) > table.width), None)
    if wide is not None:
        raise InputFileError(path, f"{len(wide[1])} cells below {table.width} names. Write numbers with a point, or "
                                   "semicolons between cells.", line=wide[0])
    values = np.array([_row(path, number, cells, table.columns) for number, cells in held[:table.rows]])
    if not len(values):
        raise InputFileError(path, "a header of quadrupoles without rows. Give one row a reading: a, b, m, n, r.")
    first = 0 if np.all(np.any(values[:, :4] == 0, axis=0)) else 1
    if values[:, :4].min() < first:
        raise InputFileError(path, "electrode 0 stands for one that is far away, and all four must be on the body "
                                   "here. Leave the row out, or count electrodes from 1.",
                             line=held[int(np.argmin(values[:, :4].min(axis=1)))][0])
    reading = table.unit * values[:, 4] / (values[:, 5] if values.shape[1] > 5 else 1.0)
    pairs = values[:, :4].astype(np.intp) - first
    each = _readings_a_frame(pairs)
    return frames(path, reading.reshape(-1, each), "voltage" if kind == "difference" else kind, pairs[:each])


def _readings_a_frame(pairs: Index) -> int:
    """How many of the quadrupoles (n, 4) make a frame: all, or those of a list that is repeated as it is."""
    again = np.flatnonzero((pairs[1:] == pairs[0]).all(axis=1)) + 1
    each = int(again[0]) if again.size else len(pairs)
    whole = len(pairs) % each == 0 and bool((pairs.reshape(-1, each, 4) == pairs[:each]).all())
    return each if whole else len(pairs)


def _row(path: Path, number: int, cells: list[str], columns: tuple[int, ...]) -> list[float]:
    try:
        row = [float(cells[k]) for k in columns]
    except (IndexError, ValueError):
        raise InputFileError(path, f"expected electrodes a, b, m, n and a resistance, got '{' '.join(cells)[:40]}'.",
                             line=number) from None
    ends = row[:4]
    if any(end % 1 or end < 0 for end in ends):
        raise InputFileError(path, f"'{' '.join(cells)[:40]}' names no electrodes by whole numbers.",
                             line=number)
    if len(row) > 5 and row[5] == 0:
        raise InputFileError(path, "the current is 0. Correct or leave out the row.", line=number)
    if ends[0] == ends[1] or ends[2] == ends[3]:
        raise InputFileError(path, "a and b, or m and n, are the same electrode. Correct or leave out the row.",
                             line=number)
    return row


FORMAT = Layout("tables of quadrupoles a, b, m, n, r (BERT .ohm, R2 .dat)", _is_table, _read_table)
