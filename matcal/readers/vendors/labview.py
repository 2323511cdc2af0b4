"""LabVIEW measurement files (.lvm): a header of keys, headers of segments, then columns X and Y, or Y alone.

`X_Columns` says how the clock is written: One (before all channels), Multi (before each channel) or No, where it
follows from X0 and Delta_X of each channel. Layout: NI, Specification for the LabVIEW Measurement File.
"""

from collections.abc import Mapping
from dataclasses import replace

from matcal.readers.cells import Grid, Style, text_grid
from matcal.readers.column_options import Selection
from matcal.readers.columns import Header, read_columns
from matcal.readers.decoding import lines_of
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from matcal.readers.units import split_name
from touchcal.errors import InputFileError

_END = "***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}


def _is_lvm(source: Source) -> bool:
    return source.text.lstrip("\ufeff \r\n").startswith("LabVIEW Measurement")


def _read_lvm(source: Source, selection: Selection | None = None) -> Recording:
    """The columns of all segments in SI, one after the other; InputFileError where no segment has numbers,
    segments have other channels, or the clock is not stated."""
    delimiter, style = _layout(source)
    grid = text_grid(source.text, source.path, delimiter, style)
    ends = [n for n, row in enumerate(grid.rows) if row[0] == _END]
    names = [n + 1 for n in ends[1:] or ends if n + 2 < len(grid.rows)]
    if not names or not grid.numeric(grid.rows[names[0] + 1]):
        raise InputFileError(source.path, "a LabVIEW measurement file without numbers below its header. Export the "
                                          "test again.", line=grid.lines[-1])
    heads = [_keys(grid, range(start, stop)) for start, stop in zip([0, *names], names, strict=False)]
    if other := next((n for n in names if grid.rows[n] != grid.rows[names[0]]), None):
        raise InputFileError(source.path, "its segments have other channels. Export each to a file of its own.",
                             line=grid.lines[other])
    said = list(source.notes) + [f"{len(names)} segments read one after the other."] * (len(names) > 1)
    file_keys = _keys(grid, range(ends[0] if ends else 0))
    cells, columns = _cells(grid, names[0], file_keys, heads[0])
    rows, lines = [], []
    for start, head, stop in zip(names, heads, [*names[1:], len(grid.rows)], strict=False):
        last = next((n for n in range(start + 1, stop)
                     if (cell := grid.rows[n][0]) and grid.number(cell) is None), stop)
        for k, n in enumerate(range(start + 1, last)):
            rows.append([*_clock(grid, head, file_keys, k), *(grid.cell(n, column) for column in columns)])
            lines.append(grid.lines[n])
    made = replace(grid, rows=rows, lines=lines)
    clock = [("Time", "s")] if _without_clock(file_keys) else []
    header = Header([*clock, *cells], grid.lines[names[0]], range(len(rows)))
    metadata = {key: " ".join(values) for key, values in file_keys.items() if values}
    return read_columns(made, header, "labview", selection, metadata=metadata, notes=said)


def _layout(source: Source) -> tuple[str, Style]:
    keys: dict[str, tuple[str, str]] = {}
    for line in lines_of(source.text)[:60]:
        for delimiter in "\t,;":
            key, found, value = line.partition(delimiter)
            if found and key in ("Separator", "Decimal_Separator"):
                keys.setdefault(key, (delimiter, value.strip(delimiter + " ")))
    separator, word = keys.get("Separator", ("\t", "Tab"))
    decimal = keys.get("Decimal_Separator", ("", "."))[1] or ","
    return _SEPARATORS.get(word.lower(), separator or "\t"), Style("," if decimal.startswith(",") else ".")


def _keys(grid: Grid, rows: range) -> Mapping[str, list[str]]:
    return {grid.rows[n][0]: grid.rows[n][1:] for n in rows}


def _without_clock(keys: Mapping[str, list[str]]) -> bool:
    return (keys.get("X_Columns") or ["One"])[0].lower() == "no"


def _cells(grid: Grid, at: int, file_keys: Mapping[str, list[str]],
           head: Mapping[str, list[str]]) -> tuple[list[tuple[str, str | None]], list[int]]:
    """Name and unit of each channel (of a clock the first alone), and its column."""
    names, cells, columns = grid.rows[at], [], []
    units = [word.split("(")[-1].strip(") ") if word else "" for word in head.get("Y_Unit_Label", [])]
    for n, name in enumerate(names):
        if name == "Comment" or (not name and grid.rows[at + 1][n:n + 1] == [""]):
            continue
        if name == "X_Value":
            if columns:
                continue
            if not _without_clock(file_keys):
                cells.append(("Time", "s") if _dimension(head) == "time" else (name, None))
                columns.append(n)
            continue
        own, unit = split_name(name)
        stated = units[n - 1] if 0 < n <= len(units) else ""
        cells.append((own, unit if unit is not None else stated or None))
        columns.append(n)
    return cells, columns


def _dimension(head: Mapping[str, list[str]]) -> str:
    return (head.get("X_Dimension") or ["Time"])[0].lower()


def _clock(grid: Grid, head: Mapping[str, list[str]], file_keys: Mapping[str, list[str]], row: int) -> list[str]:
    """The time of a row of a segment without a column of it."""
    if not _without_clock(file_keys):
        return []
    start, step = (grid.number((head.get(key) or [""])[0]) for key in ("X0", "Delta_X"))
    if start is None or step is None:
        raise InputFileError(grid.path, "X_Columns is No, and X0 and Delta_X do not state a clock. Export it with "
                                        "X_Columns One.", line=grid.lines[0])
    return [repr(start + row * step).replace(".", grid.style.decimal)]


READER = Reader("labview", "LabVIEW measurement file", _is_lvm, _read_lvm)
