"""Text of a file and the numbers in it, with the line of whatever is wrong."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from matcal.errors import TestFileError
from matcal.readers.recording import QUANTITIES, Array
from matcal.readers.units import quantity_of, si_factor


@dataclass(frozen=True)
class Layout:
    """How the cells of a line are told apart."""

    # cell separator; None for any run of blanks
    delimiter: str | None
    # "." or ","
    decimal: str

    def cells(self, line: str) -> list[str]:
        """The cells of one line, without blanks and quotes around them."""
        parts = line.rstrip("\r\n").split(self.delimiter)
        return [cell.strip().strip('"').strip() for cell in parts]

    def number(self, cell: str) -> float | None:
        """The value of a cell, None where it is no number."""
        try:
            return float(cell.replace(",", ".") if self.decimal == "," else cell)
        except ValueError:
            return None


LAYOUTS = tuple(Layout(d, p) for d in ("\t", ";", ",", None) for p in (".", ",") if d != p)


def read_text(path: Path) -> str:
    """The text of a file without its byte-order mark; TestFileError where it is missing, empty or not text."""
    if path.is_dir():
        raise TestFileError(path, "this is a folder. Give one file, or a folder of the parts of one MTS test.")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise TestFileError(path, "no such file. Check the name and the folder.") from None
    if data[:4] == b"PK\x03\x04":
        raise TestFileError(path, "this is a workbook or an archive, not text. Export the test as text or CSV.")
    text = _decode(data, path)
    if not text.strip():
        raise TestFileError(path, "the file is empty. Export the test again.")
    return text


def _decode(data: bytes, path: Path) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        from charset_normalizer import from_bytes

        best = from_bytes(data).best()
        if best is None:
            raise TestFileError(path, "this is not text in any known encoding. Export it as UTF-8 text.") from None
        return str(best).removeprefix("\ufeff")


def sniff(lines: Sequence[str]) -> Layout | None:
    """The layout under which most of the last lines are rows of at least two numbers; None where there is none."""
    tail = [line for line in lines if line.strip()][-20:]

    def rows(layout: Layout) -> int:
        cells = [layout.cells(line) for line in tail]
        return sum(len(row) > 1 and sum(layout.number(c) is not None for c in row) > 1 for row in cells)

    best = max(LAYOUTS, key=rows)
    return best if rows(best) else None


def column_numbers(lines: Sequence[str], first_line: int, layout: Layout, columns: Sequence[int],
                   names: Sequence[str], path: Path) -> Array:
    """(n, len(columns)) numbers of `lines`, the first of which is line `first_line` of the file.

    TestFileError names the line of a cell that is missing, no number, or not finite.
    """
    kept = [(n, line) for n, line in enumerate(lines, first_line) if line.strip()]
    if not kept:
        raise TestFileError(path, "no numbers stand below the names. Export the test again.", line=first_line - 1)
    text = "\n".join(line.replace('"', "") for _, line in kept)
    try:
        out = np.loadtxt(io.StringIO(text.replace(",", ".") if layout.decimal == "," else text), comments=None,
                         delimiter=layout.delimiter, usecols=list(columns), ndmin=2)
    except ValueError:
        out = None
    if out is None or not np.all(np.isfinite(out)):
        raise _wrong_cell(kept, layout, columns, names, path)
    return out


def _wrong_cell(lines: Sequence[tuple[int, str]], layout: Layout, columns: Sequence[int], names: Sequence[str],
                path: Path) -> TestFileError:
    for n, line in lines:
        cells = layout.cells(line)
        for column, name in zip(columns, names, strict=True):
            cell = cells[column] if column < len(cells) else ""
            value = layout.number(cell)
            if value is None or not math.isfinite(value):
                what = f"'{cell}' is not a finite number" if cell else "the cell is missing"
                return TestFileError(path, f"column '{name}': {what}. Correct or delete the row.", line=n)
    return TestFileError(path, f"the numbers of {', '.join(names)} cannot be read.")


def recognised(cells: Sequence[tuple[str, str | None]], path: Path, line: int) -> dict[str, int]:
    """Quantity -> column index of the header cells (name, unit); TestFileError where two columns say the same."""
    out: dict[str, int] = {}
    for n, (name, _) in enumerate(cells):
        if (quantity := quantity_of(name)) is None:
            continue
        if quantity in out:
            raise TestFileError(path, f"columns '{cells[out[quantity]][0]}' and '{name}' are both {quantity}. "
                                      "Keep one of them.", line=line)
        out[quantity] = n
    return out


def factor(name: str, unit: str, quantity: str, path: Path, line: int) -> float:
    """SI factor of a column; TestFileError where its unit is missing or measures something else."""
    value = si_factor(unit, quantity)
    if value is None:
        problem = f"has the unit '{unit}', which is no unit of {quantity}" if unit else "has no unit"
        example = {"Pa": "kPa", "m": "mm", "A": "mA"}.get(QUANTITIES[quantity], QUANTITIES[quantity])
        raise TestFileError(path, f"column '{name}' {problem}. Put a row of units below the names (for example "
                                  f"-,kPa) or write '{name} ({example or '-'})'.", line=line)
    return value
