"""The text of a file: what is on disk, in whatever encoding, as lines."""

import re
from collections.abc import Callable
from pathlib import Path

from touchcal.errors import InputFileError
from touchcal.input_file import regular

# first bytes of other files that hold tables -> what they are, and how to make text of them
_BINARY = {b"\x89HDF\r\n": "this is an HDF5 file. Export its table as CSV.",
           b"%PDF": "this is a PDF. Export the test as CSV.", b"\x89PNG": "this is an image. Export the test as CSV.",
           b"\xff\xd8\xff": "this is an image. Export the test as CSV.",
           b"\x1f\x8b": "this is a compressed file (gzip). Unpack it, or export the test as CSV.",
           b"MATLAB 5.0": "this is a MATLAB file. Export its table as CSV.",
           b"SQLite format 3": "this is a database (SQLite). Export the test as CSV.",
           b"PAR1": "this is a Parquet file. Export its table as CSV."}
_CONTROLS = re.compile("[\x01-\x08\x0e-\x1a\x1c-\x1f]")
# code pages of single languages, of which the names in a file show the right one; lines that are looked at
_CODE_PAGES, _TELLING_LINES = ("cp1250", "cp1251", "cp932", "euc_kr", "big5", "cp1254", "cp1253"), 50
_MOST_CONTROLS = 1e-3  # share of characters that control a terminal or nothing, as no text has
_UNKNOWN = "this is a binary file of a kind that is not known here. Export the test as text (CSV, UTF-8)."


def read_bytes(path: Path) -> bytes:
    """The bytes of a file; InputFileError where there is no such file, it is no regular one, or cannot be opened."""
    if path.is_dir():
        raise InputFileError(path, "this is a folder. Give one file, or a folder of the parts of one MTS test.")
    try:
        return regular(path).read_bytes()
    except OSError as error:
        raise InputFileError(path, f"it cannot be opened ({error}).") from None


def decode(data: bytes, path: Path, named: Callable[[str], bool]) -> tuple[str, str]:
    """(text without its byte-order mark, encoding) of a file's bytes, of which `named` says whether a cell names a
    quantity; InputFileError where they are empty or no text."""
    if not data.strip(b"\xef\xbb\xbf\xff\xfe \t\r\n\x00"):
        raise InputFileError(path, "the file is empty. Export the test again.")
    for begin, problem in _BINARY.items():
        if data.startswith(begin):
            raise InputFileError(path, problem)
    for encoding in _by_names(data, _candidates(data), named):
        text = (_decoded(data, encoding) or "").removeprefix("\ufeff")
        if "\x00" not in text and text.strip():
            if len(_CONTROLS.findall(text[:100_000])) > _MOST_CONTROLS * min(len(text), 100_000):
                break
            return text, encoding
    raise InputFileError(path, _UNKNOWN)


def lines_of(text: str) -> list[str]:
    """Lines as editors count them: ended by LF, CRLF or CR, and by nothing else."""
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _candidates(data: bytes) -> list[str]:
    """Encodings to try: what a mark says, UTF-8, then what the bytes outside ASCII look like."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return ["utf-16"]
    if b"\x00" in data[:200]:
        return ["utf-16-le", "utf-16-be"]
    runs = [len(run) for run in re.findall(rb"[\x80-\xff]+", data)]
    if all(run == 1 for run in runs):
        # umlauts, micro and degree signs stand alone between ASCII letters
        return ["utf-8", "cp1252", "latin-1"]
    double = ["gb18030"] if sum(run % 2 == 0 for run in runs) > len(runs) / 2 else []
    return ["utf-8", *double, *_guessed(data), "gb18030"]


def _by_names(data: bytes, candidates: list[str], named: Callable[[str], bool]) -> list[str]:
    """The candidates, and code pages of other languages, in the order of how many names of quantities each makes of the
    lines that are not plain ASCII; UTF-8 and UTF-16 go first."""
    if candidates[0] != "utf-8" or data.isascii() or _decoded(data, "utf-8") is not None:
        return candidates
    telling = b"\n".join([line for line in data.splitlines() if not line.isascii()][:_TELLING_LINES])

    def names(encoding: str) -> int:
        text = _decoded(telling, encoding) or ""
        return -sum(named(cell.strip(' "')) for cell in re.split(r"[\t;,\n]", text) if not cell.isascii())

    return sorted(dict.fromkeys([*candidates, *_CODE_PAGES]), key=names)


def _decoded(data: bytes, encoding: str) -> str | None:
    try:
        return data.decode(encoding)
    except (UnicodeDecodeError, LookupError):
        return None


def _guessed(data: bytes) -> list[str]:
    """What charset-normalizer makes of the lines that are not plain ASCII."""
    from charset_normalizer import from_bytes

    telling = [line for line in data.splitlines() if not line.isascii()][:200]
    best = from_bytes(b"\n".join(telling)[:20_000]).best()
    return [best.encoding] if best is not None else []
