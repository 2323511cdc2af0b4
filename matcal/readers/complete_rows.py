"""Rows in which only some columns of a table have a number: where one channel runs on, and gaps within the record."""

import math
from collections.abc import Mapping
from dataclasses import replace

from matcal.readers.cells import Grid, shown
from touchcal.errors import InputFileError

_FEWEST, _ENOUGH, _MOST = 3, 20, 0.05  # rows of a record, those of one whose gaps are left out, their share
_EMPTY = {"", "nan", "n/a", "#n/a", "-nan", "null", "none", "---", "--", "-"}


def complete(grid: Grid, rows: range, columns: Mapping[int, str], said: list[str]) -> tuple[Grid, range]:
    """The grid without the rows in which a used column (number -> name) is empty or NaN, at either end and, where they
    are few, within; what was left out is said. InputFileError where an end that is left out holds most of the rows."""
    gaps = [any(_empty(grid, n, column) for column in columns) for n in rows]
    if not any(gaps) or all(gaps):
        return grid, rows
    first, last = gaps.index(False), len(gaps) - gaps[::-1].index(False)
    if last - first < _FEWEST:
        return grid, rows
    if 2 * (last - first) < len(gaps):
        raise _mostly_open(grid, rows, columns)
    within = [k for k in range(first, last) if gaps[k]]
    dropped = within if len(gaps) >= _ENOUGH and len(within) <= _MOST * len(gaps) else []
    for count, where, line in ((first, "first", rows[0]), (len(gaps) - last, "last", rows[min(last, len(gaps) - 1)])):
        if count:
            said.append(f"the {where} {count} rows (from line {grid.lines[line]}) have only some of the columns and "
                        "were left out." if count > 1 else
                        f"the {where} row (line {grid.lines[line]}) has only some of the columns and was left out.")
    if dropped:
        said.append(f"{len(dropped)} rows within the record have a column without a number (the first in line "
                    f"{grid.lines[rows[dropped[0]]]}) and were left out.")
    kept = [*range(rows.start), *(rows[k] for k in range(first, last) if k not in set(dropped))]
    return replace(grid, rows=[grid.rows[n] for n in kept], lines=[grid.lines[n] for n in kept]), \
        range(rows.start, len(kept))


def _empty(grid: Grid, row: int, column: int) -> bool:
    cell = grid.cell(row, column)
    if cell.lower() in _EMPTY:
        return True
    value = grid.number(cell)
    return value is not None and math.isnan(value)


def _mostly_open(grid: Grid, rows: range, columns: Mapping[int, str]) -> InputFileError:
    counts = {name: sum(not _empty(grid, n, column) for n in rows) for column, name in columns.items()}
    short = min(counts, key=lambda name: counts[name])
    return InputFileError(grid.path, f"column '{shown(short)}' has numbers in {counts[short]} of "
                                     f"{len(rows)} rows. Leave it out by choosing the other columns with --columns, or "
                                     "export it separately.",
                          line=grid.lines[rows[0]])
