"""Instron CSV exports: 0 to 24 lines `key,value,unit`, a blank line, names, units in brackets, quoted numbers.

Layout as Bluehill writes its raw data: numbers may carry thousands commas or a decimal comma, names may be in any
language, and a file may begin with a blank line.
"""

import re

from matcal.readers.cells import Grid
from matcal.readers.column_options import Selection
from matcal.readers.columns import Header, read_columns
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from matcal.readers.specimen_metadata import metadata_of, sizes_of
from touchcal.errors import InputFileError

_HEAD = 60  # lines in which the units are looked for
_SHORT = 10  # a table with this many times fewer rows than the longest is one of results


def _is_instron(source: Source) -> bool:
    return bool(_units_rows(source.grid))


def _read_instron(source: Source, selection: Selection | None = None) -> Recording:
    """Columns in SI, sizes of the specimen from its property lines; InputFileError where several tables follow one
    another, or a column cannot be read."""
    grid = source.grid
    at, *more = _units_rows(grid)
    if more:
        raise InputFileError(grid.path, f"{len(more) + 1} tables stand one below the other. Export each specimen to a "
                                        "file of its own.", line=grid.lines[more[0]])
    units, names = grid.rows[at], grid.rows[at - 1]
    cells = [(re.sub(r"\s*[(（][^()（）]*[)）]$", "", name), units[n].strip("()（） ") if n < len(units) else "")
             for n, name in enumerate(names)]
    sizes, said = sizes_of(grid, range(at - 1))
    header = Header(cells, grid.lines[at], range(at + 1, len(grid.rows)))
    return read_columns(grid, header, "instron", selection, metadata=metadata_of(grid.rows[:at - 1]), sizes=sizes,
                        notes=[*source.notes, *said])


def _units_rows(grid: Grid) -> list[int]:
    """Rows of bracketed units between a row of as many names and a row of numbers; a table of results, which is
    short next to the record, is not one."""
    found: dict[int, int] = {}
    for n in range(1, min(len(grid.rows) - 1, _HEAD)):
        cells = [cell for cell in grid.rows[n] if cell]
        if len(cells) > 1 and all(re.fullmatch(r"[(（].{0,20}[)）]", cell) for cell in cells) \
                and len(grid.rows[n - 1]) >= len(cells) and grid.numeric(grid.rows[n + 1]) > 1:
            found[n] = next((m for m in range(n + 1, len(grid.rows)) if grid.numeric(grid.rows[m]) < 2),
                            len(grid.rows)) - n
    return [n for n, rows in found.items() if rows > max(found.values()) / _SHORT]


READER = Reader("instron", "Instron export", _is_instron, _read_instron)
