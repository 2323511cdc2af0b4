"""One door to every reader: the layout is known from what the file holds, never from its name."""

import re
from dataclasses import replace
from pathlib import Path

from matcal.readers import vendors
from matcal.readers.column_options import Selection
from matcal.readers.columns import check_clock
from matcal.readers.decoding import decode, read_bytes
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from matcal.readers.specimens import specimens_of
from matcal.readers.units import split_name
from matcal.readers.vendors.mts_testsuite import join_parts, sibling_parts
from matcal.readers.vendors.xlsx import TABLES, read_workbook
from matcal.readers.vocabulary import quantity_of
from touchcal.errors import InputFileError

# the line of a file, alone or as a comment, that says that nothing was measured; where it is looked for
_MARK, _HEAD, _ROWS = re.compile(r"^[#\s]*touchcal-synthetic:\s*1[\s;,]*$", re.MULTILINE), 4096, 40


def read(path: Path | str, selection: Selection | None = None) -> Recording:
    """The columns of one file in SI, of however many specimens, or of a folder of the parts of one TestSuite test. A
    file that is one part of a split test brings its other parts along; `selection` says which columns mean what where
    the file does not. InputFileError names what is wrong, where, and the fix."""
    path = Path(path)
    files = files_of(path)
    whole = _read_parts(path, files, selection) if path.is_dir() or len(files) > 1 else _read_file(path, selection)
    for part in specimens_of(whole):
        check_clock(part)
    return whole


def files_of(path: Path) -> list[Path]:
    """Every file that `read(path)` opens: those of a folder, or a file and the further parts of its test."""
    if path.is_dir():
        return sorted(p for p in path.iterdir() if p.suffix.lower() == ".txt")
    return sibling_parts(path)


def _read_file(path: Path, selection: Selection | None) -> Recording:
    source = _open(path, selection.sheet if selection else None)
    reader = next(reader for reader in vendors.readers() if _recognises(reader, source))
    if selection is not None and selection.block is not None and not reader.has_blocks:
        raise InputFileError(path, f"`columns` asks for block {selection.block}, but only MTS 793 files have blocks.")
    found = reader.read(source, selection)
    return replace(found, synthetic=True) if _is_synthetic(source) else found


def _is_synthetic(source: Source) -> bool:
    """Whether a line near the beginning of a file, or a row of a sheet, is the mark of generated data."""
    head = source.text[:_HEAD] if source.sheet is None else "\n".join(
        " ".join(cell for cell in row if cell) for row in source.sheet.rows[:_ROWS])
    return _MARK.search(head) is not None


def _recognises(reader: Reader, source: Source) -> bool:
    """Whether a reader knows a file; not where it asks for cells of a text that has no table of a known separator."""
    try:
        return reader.recognises(source)
    except InputFileError:
        return False


def _open(path: Path, sheet: str | None) -> Source:
    data = read_bytes(path)
    if data.startswith(TABLES):
        grid, notes = read_workbook(data, path, sheet)
        return Source(path, "", grid, notes)
    text, encoding = decode(data, path, lambda cell: quantity_of(split_name(cell)[0]) is not None)
    if sheet is not None:
        raise InputFileError(path, f"`columns` asks for sheet '{sheet}', but this is text without sheets.")
    return Source(path, text, notes=() if encoding == "utf-8" else (f"read as {encoding}.",))


def _read_parts(path: Path, files: list[Path], selection: Selection | None) -> Recording:
    empty = [file for file in files if not read_bytes(file).removeprefix(b"\xef\xbb\xbf").strip()]
    parts = []
    for file in files:
        if file in empty:
            continue
        part = _read_file(file, selection)
        if part.vendor != "mts_testsuite":
            raise InputFileError(file, "not a part of a TestSuite test. A folder stands for one test that TestSuite "
                                       "split into parts; keep other files out of it, or give the files one by one.")
        parts.append(part)
    if not parts:
        raise InputFileError(path, f"no TestSuite text file with numbers in it{_contents(path)}. A folder stands for "
                                   "one test that TestSuite split into parts; give other files one by one.")
    return replace(join_parts(parts, empty), synthetic=any(part.synthetic for part in parts))


def _contents(folder: Path) -> str:
    names = sorted(p.name for p in folder.iterdir() if not p.name.startswith(".")) if folder.is_dir() else []
    return f" (it holds {', '.join(names[:5])}{' ...' if len(names) > 5 else ''})" if names else ""
