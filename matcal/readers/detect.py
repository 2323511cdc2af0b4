"""One door to every reader: the layout is told from the file's first lines."""

from __future__ import annotations

from pathlib import Path

from matcal.errors import TestFileError
from matcal.readers.mts_testsuite import is_testsuite, join_parts, read_testsuite, sibling_parts
from matcal.readers.nova import is_impedance, is_nova, read_nova
from matcal.readers.plain import read_plain
from matcal.readers.recording import Recording
from matcal.readers.table import read_text


def read(path: Path | str) -> Recording:
    """The columns of one test in SI, from a file or a folder of the parts of one TestSuite test.

    A file that is one part of a split test brings its other parts along. TestFileError names what is wrong, where, and
    the mend.
    """
    path = Path(path)
    files = files_of(path)
    return _read_parts(path, files) if path.is_dir() or len(files) > 1 else _read_file(path)


def files_of(path: Path) -> list[Path]:
    """Every file that `read(path)` opens: those of a folder, or a file and the further parts of its test."""
    if path.is_dir():
        return sorted(p for p in path.iterdir() if p.suffix.lower() == ".txt")
    return sibling_parts(path)


def _read_file(path: Path) -> Recording:
    text = read_text(path)
    if text.startswith("MTS793|"):
        raise TestFileError(path, "this is an MTS 793 file; reading it is not built yet. Export the test as plain CSV.")
    if is_testsuite(text):
        return read_testsuite(text, path)
    if is_impedance(text):
        raise TestFileError(path, "this is an impedance spectrum (frequency, Z', Z''), not a record of current over "
                                  "time. Export the chronoamperometry of the test.")
    return read_nova(text, path) if is_nova(text) else read_plain(text, path)


def _read_parts(path: Path, files: list[Path]) -> Recording:
    empty = [file for file in files if not file.read_bytes().removeprefix(b"\xef\xbb\xbf").strip()]
    parts = [_read_file(file) for file in files if file not in empty]
    if not parts:
        raise TestFileError(path, "no TestSuite text file with numbers in it. Give a file, or a folder of the parts of "
                                  "one test.")
    if stranger := next((part for part in parts if part.vendor != "mts_testsuite"), None):
        raise TestFileError(stranger.paths[0], "not a part of a TestSuite test. Keep other files out of its folder.")
    return join_parts(parts, empty)
