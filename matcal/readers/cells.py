"""A file as rows of cells, each row with its line, and the way its numbers are written."""

import csv
import itertools
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from matcal.readers.clocks import elapsed, seconds_of
from matcal.readers.decoding import lines_of
from touchcal.arrays import Array
from touchcal.errors import InputFileError

DELIMITERS = ("\t", ";", ",", None)
_NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+|\d{1,3}(?:,\d{3})+(?:\.\d*)?|\d{1,3}(?:\.\d{3})+(?:,\d*)?)"
                     r"(?:[eE][-+]?\d{1,3})?")
_COMMA_GROUPS = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+")
_DOT_GROUPS = re.compile(r"[-+]?[1-9]\d{0,2}(?:\.\d{3})+")
_TELLING = 20  # rows of a file's end that tell its delimiter
_VOTES = 2000  # numbers that settle how all are written


@dataclass(frozen=True)
class Style:
    """How a number is written."""

    decimal: str = "."  # "." or ","
    thousands: str = ""  # "," or "." between groups of three digits, "" where there are none

    def number(self, cell: str) -> float | None:
        """The value of a cell, None where it is no number."""
        if self.thousands and self.thousands in cell:
            whole = cell.partition(self.decimal)[0]
            if not (_COMMA_GROUPS if self.thousands == "," else _DOT_GROUPS).fullmatch(whole):
                return None
            cell = cell.replace(self.thousands, "")
        if self.decimal == ",":
            if "." in cell:
                return None
            cell = cell.replace(",", ".")
        try:
            return float(cell) if "_" not in cell else None
        except ValueError:
            return None


@dataclass(frozen=True)
class Grid:
    """The rows of a file or sheet that are not blank."""

    path: Path
    rows: Sequence[list[str]]  # rows of cells, without blanks and quotes around them and without empty cells at the end
    lines: Sequence[int]  # line of each row in the file (row of the sheet), counted from 1
    style: Style = Style()  # how its numbers are written
    sheet: str = ""  # name of the sheet it came from, "" for text
    clocks: frozenset[int] = frozenset()  # columns that were clocks (10:00:01) and are seconds from the first row now

    def number(self, cell: str) -> float | None:
        """The value of a cell, None where it is no number."""
        return self.style.number(cell)

    def numeric(self, row: Sequence[str]) -> int:
        """How many cells of a row are numbers."""
        return sum(self.style.number(cell) is not None for cell in row)

    def cell(self, row: int, column: int) -> str:
        """A cell, "" past the end of its row."""
        cells = self.rows[row]
        return cells[column] if column < len(cells) else ""

    def numbers(self, rows: range, column: int, name: str) -> Array:
        """(len(rows),) values of one column; InputFileError names the line of a cell that is no finite number."""
        out = np.empty(len(rows))
        for k, row in enumerate(rows):
            value = self.style.number(self.cell(row, column))
            if value is None or not math.isfinite(value):
                cell = self.cell(row, column)
                what = f"'{shown(cell)}' is not a finite number" if cell else "the cell is missing"
                fix = "Correct or delete the row." if (again := self._names_again(rows, row)) is None else (
                    f"The names of the columns stand again in line {again}. Save each block as a file of its own, or, "
                    "where they are one test, delete the lines between them.")
                raise InputFileError(self.path, f"column '{shown(name)}': {what}. {fix}", line=self.lines[row])
            out[k] = value
        return out

    def _names_again(self, rows: range, first: int) -> int | None:
        """The line below the first of some rows without numbers that repeats one above all `rows`: another block's
        names; None where there is none."""
        above = [cells for cells in self.rows[:rows.start] if len(cells) > 1]
        between = itertools.takewhile(lambda n: not self.numeric(self.rows[n]), range(first, rows.stop))
        return next((self.lines[n] for n in between if self.rows[n] in above), None)


def shown(text: str, most: int = 40) -> str:
    """A cell as a message shows it: on one line, cut where it is long, what cannot be printed left out."""
    text = "".join(c for c in " ".join(text.split()) if c.isprintable())
    return text if len(text) <= most else text[:most - 1] + "…"


def no_table(path: Path) -> InputFileError:
    """The error of a file in which no row holds two numbers."""
    return InputFileError(path, "no table of numbers in two or more columns was found. Expected a line of names such "
                                "as strain,stress, a line of units such as -,kPa, then the numbers.")


def text_grid(text: str, path: Path, delimiter: str | None = "", style: Style | None = None) -> Grid:
    """The grid of a text; delimiter ("" to find it; None for any run of blanks) and style follow from its numbers.
    InputFileError where no line holds two numbers, or where 1,424 may be either of two numbers."""
    numbered = [(n, line) for n, line in enumerate(lines_of(text), 1) if line.strip()]
    lines = [line for _, line in numbered]
    if delimiter == "":
        delimiter = _delimiter(lines, path)
    rows = [_cells(line, delimiter, path, n) for n, line in numbered]
    kept = [k for k, row in enumerate(rows) if row]
    grid = Grid(path, [rows[k] for k in kept], [numbered[k][0] for k in kept])
    return with_seconds(replace(grid, style=style or style_of(grid.rows, path)))


def with_seconds(grid: Grid) -> Grid:
    """The grid with each column of clocks as seconds from its first row."""
    found: dict[int, int] = {}
    for row in grid.rows[-_TELLING:]:
        for column, cell in enumerate(row):
            if seconds_of(cell) is not None:
                found[column] = found.get(column, 0) + 1
    clocks = [column for column, count in found.items() if 2 * count >= min(len(grid.rows), _TELLING)
              or (count > 1 and 3 * count >= len(grid.rows))]
    rows = list(grid.rows)
    for column in clocks:
        for n, value in enumerate(elapsed([grid.cell(n, column) for n in range(len(rows))])):
            if value is not None:
                cells = list(rows[n])
                cells[column] = repr(value).replace(".", grid.style.decimal)
                rows[n] = cells
    return replace(grid, rows=rows, clocks=frozenset(clocks)) if clocks else grid


def _cells(line: str, delimiter: str | None, path: Path, number: int) -> list[str]:
    if delimiter is None:
        cells = line.split()
    elif not re.search(rf'(?:^|{re.escape(delimiter)})\s*"', line):  # a mark within a cell is a second prime
        cells = [cell.strip() for cell in line.split(delimiter)]
    else:
        if line.count('"') % 2:
            raise InputFileError(path, "a quotation mark is opened and never closed.", line=number)
        try:
            cells = [cell.strip().strip('"').strip() for cell in next(csv.reader((line,), delimiter=delimiter))]
        except csv.Error as error:
            raise InputFileError(path, f"the cells cannot be separated ({error}).", line=number) from None
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _delimiter(lines: Sequence[str], path: Path) -> str | None:
    """The separator under which the last lines are rows of at least two numbers. Tabs and semicolons go before commas
    and blanks, which also stand inside cells; of two, the one with fuller rows."""
    half = lines[len(lines) // 2:-_TELLING]
    tail = [*half[::max(len(half) // _TELLING, 1)], *lines[-_TELLING:]]  # the end alone may hold one column running on

    def score(delimiter: str | None) -> tuple[int, float]:
        rows = [[cell.strip().strip('"').strip() for cell in _split(line, delimiter)] for line in tail]
        counts = [(sum(_NUMBER.fullmatch(cell) is not None or seconds_of(cell) is not None for cell in row), len(row))
                  for row in rows]
        full = [(found, size) for found, size in counts if found > 1]
        return len(full), sum(found for found, _ in full) / max(sum(size for _, size in full), 1)

    scores = {delimiter: score(delimiter) for delimiter in DELIMITERS}
    most = max(rows for rows, _ in scores.values())
    clear = [delimiter for delimiter in ("\t", ";") if scores[delimiter][0] >= max(most / 2, 1)]
    best = max(clear or DELIMITERS, key=lambda delimiter: scores[delimiter])
    if not most:
        raise no_table(path)
    return best


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None or '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader((line,), delimiter=delimiter))
    except csv.Error:
        return []


def style_of(rows: Iterable[Sequence[str]], path: Path) -> Style:
    """How the numbers of a table are written, from cells that leave no choice; InputFileError where none does. Where
    1,424 stands next to 0.5 it is 1424, next to 0,5 it is 1.424; alone it is refused."""
    dots, commas, doubtful = 0, 0, ""
    for cell in _number_cells(rows):
        dot, comma = cell.rfind("."), cell.rfind(",")
        if comma > dot:
            if dot < 0 and _COMMA_GROUPS.fullmatch(cell):
                doubtful = cell
            else:
                commas += 1
        elif comma >= 0 or not _DOT_GROUPS.fullmatch(cell):
            dots += 1
        if dots + commas >= _VOTES:
            break
    if commas > dots:
        return Style(",", ".")
    if doubtful and not dots:
        raise InputFileError(path, f"numbers such as '{doubtful}' may have a decimal comma or groups of thousands, and "
                                   "no number in the file tells which. Write them with a decimal point.")
    return Style(".", ",")


def _number_cells(rows: Iterable[Sequence[str]]) -> Iterable[str]:
    """Cells that are numbers with a mark in them, of rows that hold two numbers or more."""
    for row in rows:
        marked = [cell for cell in row if "," in cell or "." in cell]
        if marked and sum(_NUMBER.fullmatch(cell) is not None for cell in row) > 1:
            yield from (cell for cell in marked if _NUMBER.fullmatch(cell))
