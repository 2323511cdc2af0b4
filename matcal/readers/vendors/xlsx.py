"""Workbooks: the sheet that holds the test, as a grid; sheets of xlsx."""

import io
import zipfile
from collections.abc import Iterator
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

from matcal.readers.cells import Grid, shown, style_of, with_seconds
from matcal.readers.vendors.tdms import MARK, groups_of
from matcal.readers.vendors.xls import OLE, old_sheets
from touchcal.errors import InputFileError

WORKBOOK = b"PK\x03\x04"
TABLES = (WORKBOOK, OLE, MARK)  # first bytes of files that hold tables by name: sheets, or groups of channels

# more than any measurement needs, less than what fills the memory
_MOST_BYTES, _MOST_CELLS, _MOST_ROWS = 400_000_000, 20_000_000, 1_048_576


def read_workbook(data: bytes, path: Path, sheet: str | None = None) -> tuple[Grid, tuple[str, ...]]:
    """The grid of `sheet`, or of the only sheet with a table, and notes on the choice. InputFileError where the
    workbook is damaged, has no such sheet, or has several with tables."""
    grids = (old_sheets if data.startswith(OLE) else groups_of if data.startswith(MARK) else _sheets)(data, path)
    names = ", ".join(f"'{shown(name)}'" for name in grids)
    if sheet is not None:
        if sheet not in grids:
            raise InputFileError(path, f"no sheet '{shown(sheet)}'; its sheets: {names}.")
        return grids[sheet], (f"sheet '{shown(sheet)}' read, as given.",) if len(grids) > 1 else ()
    tables = {name: grid for name, grid in grids.items() if sum(grid.numeric(row) > 1 for row in grid.rows) > 1}
    if not tables:
        raise InputFileError(path, f"no table of numbers in two or more columns on any sheet ({names}).")
    if len(tables) > 1:
        raise InputFileError(path, f"{len(tables)} sheets hold tables: {', '.join(map(repr, map(shown, tables)))}. "
                                   f"Choose one, for example `columns` \"{path.name}=sheet={next(iter(tables))}\".")
    (name, grid), = tables.items()
    return grid, (f"sheet '{shown(name)}' read, the only one with a table.",) if len(grids) > 1 else ()


def _sheets(data: bytes, path: Path) -> dict[str, Grid]:
    """Sheet name -> grid. What a parser of damaged XML may raise is open-ended, hence the broad except."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(part.file_size for part in archive.infolist())
        if size > _MOST_BYTES:
            raise InputFileError(path, f"the workbook unpacks to {size / 1e6:.0f} MB. Export the test as CSV.")
        return _parsed(data, path)
    except (InputFileError, MemoryError):
        raise
    except Exception as error:
        raise InputFileError(path, "this workbook is damaged, or no xlsx workbook at all "
                                   f"({type(error).__name__}). Save it again, or export the test as CSV.") from None


def _parsed(data: bytes, path: Path) -> dict[str, Grid]:
    import warnings

    import openpyxl

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        try:
            grids = {sheet.title: _grid(sheet, path) for sheet in book.worksheets}
        finally:
            book.close()
    return {name: grid for name, grid in grids.items() if grid.rows}


def _grid(sheet: Any, path: Path) -> Grid:
    sheet.reset_dimensions()
    numbered = list(_rows(sheet, path))
    rows = [row for _, row in numbered]
    return with_seconds(Grid(path, rows, [n for n, _ in numbered], style_of(rows, path), sheet.title))


def _rows(sheet: Any, path: Path) -> Iterator[tuple[int, list[str]]]:
    seen = 0
    for n, values in enumerate(sheet.iter_rows(values_only=True, max_row=_MOST_ROWS), 1):
        seen += len(values)
        if seen > _MOST_CELLS:
            raise InputFileError(path, f"sheet '{shown(sheet.title)}' has more than {_MOST_CELLS:,} cells.", line=n)
        cells = [_text(value) for value in values]
        while cells and not cells[-1]:
            cells.pop()
        if cells:
            yield n, cells


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, date | datetime):
        return value.isoformat()
    if isinstance(value, timedelta):
        minutes, seconds = divmod(value.total_seconds(), 60)
        return f"{int(minutes) // 60}:{int(minutes) % 60:02d}:{seconds:09.6f}"
    return repr(value) if isinstance(value, float) else str(value).strip()
