"""Autolab NOVA exports, text or sheet: names with units in brackets, dot or comma as decimal mark, text cells.

The clock is the procedure's and need not start at 0; the order of columns varies, so they are matched by name.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NoReturn

from matcal.readers.cells import Grid
from matcal.readers.column_options import Selection
from matcal.readers.columns import Header, read_columns
from matcal.readers.decoding import lines_of
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from matcal.readers.units import split_name
from touchcal.errors import InputFileError

_HEAD = 20  # lines in which the names of the columns are looked for


def _is_nova(source: Source) -> bool:
    return _names_row(source.grid) is not None


def _is_impedance(source: Source) -> bool:
    lines = [[line] for line in lines_of(source.text[:20_000]) if line.strip()]
    return _begins_as_impedance(lines) or _begins_as_impedance(source.grid.rows)


def _refuse_impedance(source: Source, selection: Selection | None = None) -> NoReturn:
    raise InputFileError(source.path, "this is an impedance spectrum (frequency, Z', Z''), not a record of current "
                                      "over time. Export the chronoamperometry of the test.")


def _begins_as_impedance(rows: Sequence[Sequence[str]]) -> bool:
    head = "\n".join(" ".join(row) for row in rows[:_HEAD]).lower()[:10_000]
    return "z60w data file" in head or (re.search(r"freq[a-z]{0,10} ?[(/\[]? ?hz", head) is not None
                                        and re.search(r"z['′’]|z ?re|re\(z\)|z_real", head) is not None)


def _read_nova(source: Source, selection: Selection | None = None) -> Recording:
    """Time, current and potential in SI; rows flagged as overload are dropped; InputFileError where one is missing."""
    grid = source.grid
    at = _names_row(grid) or 0
    header = [split_name(cell) for cell in grid.rows[at]]
    if at + 1 == len(grid.rows):
        raise InputFileError(grid.path, "no numbers stand below the names. Export the test again.", line=grid.lines[at])
    kept, said = _without_overload(grid, at, list(source.notes))
    got = read_columns(kept, Header(header, grid.lines[at], range(at + 1, len(kept.rows))), "nova", selection,
                       notes=said)
    requested = () if selection is not None and selection.columns else ("time", "current")
    if missing := [q for q in requested if q not in got.columns]:
        found = ", ".join(name for name, _ in header)
        raise InputFileError(grid.path, f"no {missing[0]} column; found: {found}.", line=grid.lines[at])
    if "time" in got.columns and got.columns["time"][0] != 0:
        got = replace(got, notes=(*got.notes, f"the procedure's clock starts at {got.columns['time'][0]:.6g} s."))
    return got


def _names_row(grid: Grid) -> int | None:
    return next((n for n, row in enumerate(grid.rows[:_HEAD]) if any(c.startswith("WE(1).") for c in row)), None)


def _without_overload(grid: Grid, at: int, said: list[str]) -> tuple[Grid, list[str]]:
    column = next((n for n, name in enumerate(grid.rows[at]) if name.lower() == "overload"), None)
    if column is None:
        return grid, said
    kept = [n for n in range(len(grid.rows)) if n <= at or "overload" not in grid.cell(n, column).lower()]
    if len(kept) == at + 1:
        raise InputFileError(grid.path, "every row is flagged as current overload. Measure again in a wider current "
                                        "range.")
    if dropped := len(grid.rows) - len(kept):
        said.append(f"{dropped} rows flagged as current overload dropped.")
    return replace(grid, rows=[grid.rows[n] for n in kept], lines=[grid.lines[n] for n in kept]), said


IMPEDANCE = Reader("impedance", "impedance spectrum", _is_impedance, _refuse_impedance)
READER = Reader("nova", "Autolab NOVA export", _is_nova, _read_nova)
