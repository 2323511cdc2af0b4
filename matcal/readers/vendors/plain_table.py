"""Plain tables: a line of names, perhaps a line of units, then numbers; text with any separator, or a sheet."""

from collections.abc import Sequence
from itertools import pairwise

from matcal.readers.cells import Grid, no_table, shown
from matcal.readers.column_options import Selection
from matcal.readers.columns import Header, flag_for, read_columns
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from matcal.readers.specimen_metadata import sizes_of
from matcal.readers.units import is_unit, quantity_in, split_name
from matcal.readers.vocabulary import quantity_of, relative_of, relaxing_of
from touchcal.errors import InputFileError

_SHORT = 10  # a table with this many times fewer rows than the longest is one of results
_EXPECTED = "strain and stress, or displacement and force (and time)"
_EXAMPLE = "for example strain,stress and below it -,kPa"


def _read_plain(source: Source, selection: Selection | None = None) -> Recording:
    grid = source.grid
    top, first = _record(grid)
    above = [n for n in range(top, first) if not grid.rows[n][0].startswith("#")]
    rows = range(first, len(grid.rows))
    above, said = _without_partial_rows(grid, above)
    header = _header(grid, above, rows) if above else _headerless(grid, rows, selection)
    sizes, stated = sizes_of(grid, [n for n in range(first) if grid.lines[n] < header.line - 1])
    comments = [", ".join(row).lstrip("# ") for row in grid.rows[:first] if row[0].startswith("#")]
    said += [*source.notes, *stated, *(f"its own comment: '{shown(comment, 200)}'." for comment in comments)]
    return read_columns(grid, header, "plain", selection, sizes=sizes, notes=said)


def _record(grid: Grid) -> tuple[int, int]:
    """The row below whatever stands above a record and its names, and its first row of numbers. A table of results,
    which is short next to the record, is not one; InputFileError where two records stand one below the other."""
    text = [n for n, row in enumerate(grid.rows)
            if (len(row) < 2 or grid.number(row[0]) is None) and grid.numeric(row) < 2]
    runs = [range(a + 1, b) for a, b in pairwise([-1, *text, len(grid.rows)]) if b > a + 1]
    if not runs:
        raise no_table(grid.path)
    tops = [0, *(run.stop for run in runs)]
    longest = max(map(len, runs))
    records = [(top, run.start) for top, run in zip(tops, runs, strict=False) if _SHORT * len(run) > longest
               and any(_known(grid.rows[n]) > 1 for n in range(top, run.start))]
    if len(records) > 1:
        raise InputFileError(grid.path, f"{len(records)} tables stand one below the other. Export each specimen to a "
                                        "file of its own.", line=grid.lines[records[1][1]])
    if not records and len(runs) > 1 and len(runs[0]) == 1 and len(runs[1]) > 1 \
            and all(map(is_unit, grid.rows[runs[0].stop])):
        return 0, runs[1].start  # channels named by numbers, their units below them
    return records[0] if records else (0, runs[0].start)


def _without_partial_rows(grid: Grid, above: list[int]) -> tuple[list[int], list[str]]:
    """The rows between names and numbers that hold no numbers, and a sentence on those that hold some."""
    names = max((n for n in above if _known(grid.rows[n]) > 1), default=None)
    partial = [n for n in above if names is not None and n > names and grid.numeric(grid.rows[n])
               and all(not cell or grid.number(cell) is not None for cell in grid.rows[n])]
    if not partial:
        return above, []
    return [n for n in above if n not in partial], [
        f"the first {len(partial)} rows of numbers (from line {grid.lines[partial[0]]}) have only some columns and "
        "were left out."]


def _known(row: Sequence[str]) -> int:
    """How many cells of a row are names of quantities."""
    return sum(quantity_in(*split_name(cell)) is not None or relative_of(cell) is not None
               or relaxing_of(split_name(cell)[0]) is not None for cell in row)


def _headerless(grid: Grid, rows: range, selection: Selection | None) -> Header:
    """A header of columns without names, where the user says what they are; InputFileError where not."""
    header = Header([("", None)] * max(len(grid.rows[n]) for n in rows[:100]), grid.lines[rows.start], rows)
    if selection is None or not selection.columns:
        raise InputFileError(grid.path, "no line of column names stands above the numbers, so the columns cannot "
                                        f"be distinguished. Name them {_EXPECTED}, {_EXAMPLE}, or say what they are, "
                                        f"for example {flag_for(grid, header)}", line=grid.lines[rows.start])
    return header


def _header(grid: Grid, above: list[int], rows: range) -> Header:
    """The line that names the columns (or that of their units) and (name, unit or None) of each."""
    known = [n for n in above if _known(grid.rows[n]) > 1]
    # of lines with no known name, the first of those with the most cells: a title is shorter than the names
    at = known[-1] if known else max(above, key=lambda n: (len(grid.rows[n]), -n))
    named = [split_name(cell) for cell in grid.rows[at]]
    below = [n for n in above if n > at]
    if not below:
        bare = all(unit is None and is_unit(name) for name, unit in named)
        return Header([(name, name) for name, _ in named] if bare else named, grid.lines[at], rows)
    units, line = grid.rows[below[0]], grid.lines[below[0]]
    if len(units) < max((n for n, (name, _) in enumerate(named, 1) if quantity_of(name) is not None), default=0):
        raise InputFileError(grid.path, f"the line of units has {len(units)} cells, that of names {len(named)}.",
                             line=line)
    below_each = [*(cell.strip("()[]") for cell in units), *[""] * len(named)]
    return Header([(name, below_each[n] if unit is None else unit) for n, (name, unit) in enumerate(named)], line, rows)


READER = Reader("plain", "plain table", lambda source: True, _read_plain)
