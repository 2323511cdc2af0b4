"""One door to every reader: the layout is told from what the file holds, never from its name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matcal.readers.cells import Grid, text_grid
from matcal.readers.column_options import Selection
from matcal.readers.columns import check_clock
from matcal.readers.decoding import WORKBOOK, decode, lines_of, read_bytes
from matcal.readers.recording import Recording
from matcal.readers.vendors.autolab_nova import is_impedance, is_nova, read_nova
from matcal.readers.vendors.instron import is_instron, read_instron
from matcal.readers.vendors.mts_793 import is_793, read_793
from matcal.readers.vendors.mts_testsuite import is_testsuite, join_parts, read_testsuite, sibling_parts
from matcal.readers.vendors.plain_table import read_plain
from matcal.readers.vendors.xlsx import read_workbook
from touchcal.errors import TestFileError


def read(path: Path | str, selection: Selection | None = None) -> Recording:
    """The columns of one test in SI, from a file or a folder of the parts of one TestSuite test.

    A file that is one part of a split test brings its other parts along; `selection` says which columns mean what
    where the file does not. TestFileError names what is wrong, where, and the mend.
    """
    path = Path(path)
    files = files_of(path)
    if path.is_dir() or len(files) > 1:
        return check_clock(_read_parts(path, files, selection))
    return check_clock(_read_file(path, selection))


def files_of(path: Path) -> list[Path]:
    """Every file that `read(path)` opens: those of a folder, or a file and the further parts of its test."""
    if path.is_dir():
        return sorted(p for p in path.iterdir() if p.suffix.lower() == ".txt")
    return sibling_parts(path)


def _read_file(path: Path, selection: Selection | None) -> Recording:
    data = read_bytes(path)
    if data.startswith(WORKBOOK):
        _refuse_block(path, selection)
        return _read_grid(*read_workbook(data, path, selection.sheet if selection else None), selection)
    text, encoding = decode(data, path)
    notes = () if encoding == "utf-8" else (f"read as {encoding}.",)
    if selection is not None and selection.sheet is not None:
        raise TestFileError(path, f"--columns asks for sheet '{selection.sheet}', but this is text without sheets.")
    if is_793(text):
        return read_793(text, path, selection)
    _refuse_block(path, selection)
    if is_testsuite(text):
        return read_testsuite(text, path, selection)
    _refuse_impedance([[line] for line in lines_of(text[:20_000]) if line.strip()], path)
    return _read_grid(text_grid(text, path), notes, selection)


def _refuse_block(path: Path, selection: Selection | None) -> None:
    if selection is not None and selection.block is not None:
        raise TestFileError(path, f"--columns asks for block {selection.block}, but only MTS 793 files have blocks.")


def _read_grid(grid: Grid, notes: tuple[str, ...], selection: Selection | None) -> Recording:
    _refuse_impedance(grid.rows, grid.path)
    if is_nova(grid):
        return read_nova(grid, selection, notes)
    return read_instron(grid, selection, notes) if is_instron(grid) else read_plain(grid, selection, notes)


def _refuse_impedance(rows: Sequence[list[str]], path: Path) -> None:
    if is_impedance(rows):
        raise TestFileError(path, "this is an impedance spectrum (frequency, Z', Z''), not a record of current over "
                                  "time. Export the chronoamperometry of the test.")


def _read_parts(path: Path, files: list[Path], selection: Selection | None) -> Recording:
    empty = [file for file in files if not read_bytes(file).removeprefix(b"\xef\xbb\xbf").strip()]
    parts = []
    for file in files:
        if file in empty:
            continue
        part = _read_file(file, selection)
        if part.vendor != "mts_testsuite":
            raise TestFileError(file, "not a part of a TestSuite test. A folder stands for one test that TestSuite "
                                      "split into parts; keep other files out of it, or give the files one by one.")
        parts.append(part)
    if not parts:
        raise TestFileError(path, f"no TestSuite text file with numbers in it{_contents(path)}. A folder stands for "
                                  "one test that TestSuite split into parts; give other files one by one.")
    return join_parts(parts, empty)


def _contents(folder: Path) -> str:
    names = sorted(p.name for p in folder.iterdir() if not p.name.startswith(".")) if folder.is_dir() else []
    return f" (it holds {', '.join(names[:5])}{' ...' if len(names) > 5 else ''})" if names else ""
