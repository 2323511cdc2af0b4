"""A CSV of numbers: a header where its first cell is no number, then rows of one width, each with its line."""

import csv
import io
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.input_file import regular
from touchcal.whole_file import written

DEAD = ("", "nan", "na", "n/a")  # cells, in small letters, of a reading that was not measured


@dataclass(frozen=True, eq=False)
class NumberTable:
    """Numbers and where they stand in their file."""

    names: tuple[str, ...]  # names of the columns; empty where the file has none
    values: Array  # (rows, columns)
    line: NDArray[np.int64]  # (rows,) line numbers from 1


def csv_lines(path: Path, what: str) -> list[tuple[int, list[str]]]:
    """Rows of a CSV of `what` with their line numbers from 1, cells stripped; comments (#) are left out, but one that
    names as many columns as the row below has. Cells may be separated as `with_commas` says. InputFileError where it is
    no text."""
    try:
        with open(regular(path), newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(with_commas(line) for line in file)
            rows = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputFileError(path, f"not a text file ({error}). Expected a CSV of {what}.") from None
    out = []
    for (line, cells), below in zip(rows, [*(cells for _, cells in rows[1:]), []], strict=False):
        if not (cells and cells[0].startswith("#")):
            out.append((line, cells))
        elif len(cells) == len(below) > 1 and not out and not below[0].startswith("#"):
            out.append((line, [cells[0].lstrip("# "), *cells[1:]]))
    return out


def csv_rows(path: Path, what: str) -> list[tuple[int, list[str]]]:
    """`csv_lines` without blank rows."""
    return [(number, cells) for number, cells in csv_lines(path, what) if any(cells)]


def with_commas(line: str) -> str:
    """A line whose cells semicolons or tabs separate, in which a comma between digits is a decimal mark, or blanks
    between numbers, with commas between its cells.

    >>> [with_commas(line) for line in ("x_mm;F_N", "1,5;2", "a\\t-0,5", "1.5  2 3", "1,2", "1,2\\t")]
    ['x_mm,F_N', '1.5,2', 'a,-0.5', '1.5,2,3', '1,2', '1,2\\t']
    """
    if (";" in line or "\t" in line.rstrip()) and line.count(",") == len(re.findall(r"(?<=\d),(?=\d)", line)):
        mark = ";" if ";" in line else "\t"
        return re.sub(r"(?<=\d),(?=\d)", ".", line).replace(mark, ",")
    if "," not in line and len(parts := line.split()) > 1 and all(map(is_numeric, parts)):
        return ",".join(parts) + line[len(line.rstrip("\r\n")):]
    return line


def without_last_commas(rows: list[tuple[int, list[str]]], width: int | None = None) -> list[tuple[int, list[str]]]:
    """Rows without the comma that each of them ends with, as loops that print `v,` write them: a last cell that is
    empty in every row and that no header names. Rows of `width` cells are left as they are."""
    named = bool(rows) and bool(rows[0][1]) and not is_numeric(rows[0][1][0])
    body = rows[1:] if named else rows
    if not body or any(len(cells) < 2 or cells[-1] for _, cells in body) or len(body[0][1]) == width:
        return rows
    if named and rows[0][1][-1] and len(rows[0][1]) == len(body[0][1]):
        return rows
    head = [(rows[0][0], rows[0][1] if rows[0][1][-1] else rows[0][1][:-1])] if named else []
    return [*head, *((line, cells[:-1]) for line, cells in body)]


def _turned(rows: int, columns: int | None) -> str:
    """What may be wrong with as many rows as columns are expected; empty for another number."""
    return f" It has {rows} rows: are rows and columns exchanged?" if rows == columns else ""


def too_wide(cells: int, expected: int) -> str:
    """What may be wrong with a row of cells that are half as many again as expected, or more; empty for another."""
    return " Write numbers with a point, not a comma." if cells >= 1.5 * expected else ""


def read_numbers(path: Path | str, columns: int | None = None, *, what: str = "numbers",
                 blanks: bool = False, left_out: Collection[str] = ()) -> NumberTable:
    """Read a CSV of numbers without blank lines and without columns that its header names as in `left_out`;
    InputFileError names the line of a row of another width than `columns` or, without it, than the first row, and the
    column of a cell that is no finite number. With `blanks`, empty cells are NaN."""
    path = Path(path)
    rows = without_last_commas(_without(csv_rows(path, what), left_out), columns)
    width = columns or (len(rows[0][1]) if rows else 0)
    for number, cells in rows:
        if len(cells) != width:
            raise InputFileError(path, f"{len(cells)} columns, expected {width} {what} a row."
                                       f"{too_wide(len(cells), width)}{_turned(len(rows), columns)}", line=number)
    names: tuple[str, ...] = ()
    if rows and not is_numeric(rows[0][1][0]):
        names, rows = tuple(rows[0][1]), rows[1:]
    if not rows:
        raise InputFileError(path, f"it holds no rows of {what}.")
    values = np.array([[math.nan if blanks and cell.lower() in DEAD else _value(path, number, column, cell, what)
                        for column, cell in enumerate(cells, start=1)] for number, cells in rows])
    return NumberTable(names, values, np.array([number for number, _ in rows], np.int64))


def _without(rows: list[tuple[int, list[str]]], names: Collection[str]) -> list[tuple[int, list[str]]]:
    """Rows without the columns that the first one names so."""
    gone = {column for column, name in enumerate(rows[0][1]) if name in names} if rows else set()
    if not gone:
        return rows
    return [(number, [cell for column, cell in enumerate(row) if column not in gone]) for number, row in rows]


def write_numbers(path: Path | str, names: Sequence[str], values: Array) -> None:
    """Write rows (rows, columns) under a header, each number with all its digits, NaN as an empty cell; the file is
    written whole or stays as it was."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    table.writerows(cells(values))
    with written(Path(path)) as file:
        file.write(text.getvalue().encode())


def cells(values: Array) -> list[list[float | str]]:
    """Rows of numbers as a CSV holds them: NaN is an empty cell."""
    return [["" if math.isnan(value) else value for value in row] for row in np.asarray(values, dtype=float).tolist()]


def is_numeric(cell: str) -> bool:
    """Whether a cell holds a number."""
    return _number(cell) is not None


def finite(path: Path, line: int, name: str, cell: str, fix: str = "leave the row out") -> float:
    """The finite number of a cell of a column; InputFileError where it holds none."""
    value = _number(cell)
    if value is None or not math.isfinite(value):
        raise InputFileError(path, f"{name} is '{cell[:20]}', no finite number. Correct it, or {fix}.", line=line)
    return value


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _value(path: Path, line: int, column: int, cell: str, what: str) -> float:
    value = _number(cell)
    if value is None or not math.isfinite(value):
        raise InputFileError(path, f"column {column} holds '{cell}', not one of the {what}. Fix it or leave the row "
                                   "out.", line=line)
    return value
