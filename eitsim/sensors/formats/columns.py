"""Text of one reading a line: a column of numbers, or columns re and im, which make one frame."""

import re
from pathlib import Path

import numpy as np

from eitsim.sensors.formats.layout import Layout, first_lines, frames, text_lines
from eitsim.sensors.recording import Recording
from touchcal.errors import InputFileError

_RE, _IM = ("re", "real"), ("im", "imag", "imaginary")


def _is_column(path: Path) -> bool:
    rows = [_cells(line) for line in first_lines(path) if line.strip()]
    return len(rows) > 1 and (all(len(row) == 1 for row in rows) or _complex(rows[0]) is not None
                              or (all(len(row) == 2 for row in rows) and _numbers(rows[0]) is not None))


def _read_column(path: Path, kind: str) -> Recording:
    rows = [(number, _cells(line)) for number, line in enumerate(text_lines(path), start=1) if line.strip()]
    names = rows[0][1]
    parts = _complex(names)
    if parts is None and len(names) == 2:
        raise InputFileError(path, "two columns without names: they may be real and imaginary parts, or two readings. "
                                   "Name them re and im in a first line, or v_000 and v_001 for a row a frame.",
                             line=rows[0][0])
    body = rows if _numbers(names) is not None else rows[1:]
    values = []
    for number, cells in body:
        found = _numbers(cells)
        if found is None or len(found) != len(names):
            raise InputFileError(path, f"expected {len(names)} numbers, one reading a line, got "
                                       f"'{' '.join(cells)[:30]}'. Correct the line.", line=number)
        values.append(found)
    table = np.array(values)
    if parts is None:
        return frames(path, table.T, kind)
    return frames(path, (table[:, parts[0]] + 1j * table[:, parts[1]])[None], kind)


def _cells(line: str) -> list[str]:
    return [cell for cell in re.split(r"[,;\s]+", line.strip()) if cell]


def _complex(names: list[str]) -> tuple[int, int] | None:
    """Columns of the real and the imaginary part."""
    low = [name.lower() for name in names]
    re_at, im_at = ([k for k, name in enumerate(low) if name in words] for words in (_RE, _IM))
    return (re_at[0], im_at[0]) if len(re_at) == len(im_at) == 1 else None


def _numbers(cells: list[str]) -> list[float] | None:
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        return None
    return values if np.isfinite(values).all() else None


FORMAT = Layout("one reading a line, a column or re, im", _is_column, _read_column)
