"""One door to every reader: the layout is known from what the file holds, never from its name."""

from pathlib import Path

from matcal.readers import vendors
from matcal.readers.column_options import Selection
from matcal.readers.columns import check_clock
from matcal.readers.decoding import decode, read_bytes
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from matcal.readers.vendors.mts_testsuite import join_parts, sibling_parts
from matcal.readers.vendors.xlsx import TABLES, read_workbook
from touchcal.errors import InputFileError


def read(path: Path | str, selection: Selection | None = None) -> Recording:
    """The columns of one test in SI, from a file or a folder of the parts of one TestSuite test. A file that is one
    part of a split test brings its other parts along; `selection` says which columns mean what where the file does not.
    InputFileError names what is wrong, where, and the fix."""
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
    source = _open(path, selection.sheet if selection else None)
    reader = next(reader for reader in vendors.READERS if _recognises(reader, source))
    if selection is not None and selection.block is not None and not reader.has_blocks:
        raise InputFileError(path, f"--columns asks for block {selection.block}, but only MTS 793 files have blocks.")
    return reader.read(source, selection)


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
    text, encoding = decode(data, path)
    if sheet is not None:
        raise InputFileError(path, f"--columns asks for sheet '{sheet}', but this is text without sheets.")
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
    return join_parts(parts, empty)


def _contents(folder: Path) -> str:
    names = sorted(p.name for p in folder.iterdir() if not p.name.startswith(".")) if folder.is_dir() else []
    return f" (it holds {', '.join(names[:5])}{' ...' if len(names) > 5 else ''})" if names else ""
