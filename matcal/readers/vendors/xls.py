"""Old workbooks (xls), read with xlrd where it is installed."""

from pathlib import Path
from typing import Any

from matcal.readers.cells import Grid, style_of, with_seconds
from touchcal.errors import InputFileError

OLE = b"\xd0\xcf\x11\xe0"


def old_sheets(data: bytes, path: Path) -> dict[str, Grid]:
    """Sheet name -> grid; InputFileError where xlrd is absent or this is no workbook. What a parser of a damaged file
    may raise is open-ended, hence the broad except."""
    try:
        import xlrd
    except ImportError:
        raise InputFileError(path, "this is an old Excel file (.xls), for which xlrd is needed: pip install "
                                   "'.[excel]' in the project's folder. Or save it as .xlsx.") from None
    try:
        with open("/dev/null", "w") as quiet:
            book = xlrd.open_workbook(file_contents=data, logfile=quiet)
        grids = {sheet.name: _grid(book, sheet, path) for sheet in book.sheets()}
    except Exception as error:
        raise InputFileError(path, "this is an old Office file, but no workbook that can be read "
                                   f"({type(error).__name__}). Save it as .xlsx.") from None
    return {name: grid for name, grid in grids.items() if grid.rows}


def _grid(book: Any, sheet: Any, path: Path) -> Grid:
    rows, lines = [], []
    for n in range(sheet.nrows):
        cells = [_text(book, cell) for cell in sheet.row(n)]
        while cells and not cells[-1]:
            cells.pop()
        if cells:
            rows.append(cells)
            lines.append(n + 1)
    return with_seconds(Grid(path, rows, lines, style_of(rows, path), sheet.name))


def _text(book: Any, cell: Any) -> str:
    from xlrd import XL_CELL_DATE, XL_CELL_NUMBER
    from xlrd.xldate import xldate_as_datetime

    if cell.ctype == XL_CELL_DATE:
        return xldate_as_datetime(cell.value, book.datemode).isoformat()
    return repr(float(cell.value)) if cell.ctype == XL_CELL_NUMBER else str(cell.value).strip()
