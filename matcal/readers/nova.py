"""Autolab NOVA text exports: names with units in brackets, semicolons, dot or comma as decimal mark, text cells.

The clock is the procedure's and need not start at 0; the order of columns varies, so they are matched by name.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from matcal.errors import TestFileError
from matcal.readers.recording import Recording
from matcal.readers.table import LAYOUTS, Layout, column_numbers, factor, recognised
from matcal.readers.units import split_name


def is_nova(text: str) -> bool:
    """Whether the first line names a potentiostat's working electrode."""
    return "WE(1)." in text.partition("\n")[0]


def is_impedance(text: str) -> bool:
    """Whether a text is an impedance spectrum rather than a record in time."""
    head = "\n".join(text.splitlines()[:20]).lower()
    return "z60w data file" in head or (re.search(r"freq\w*\s*\(hz\)", head) is not None and "z'" in head)


def read_nova(text: str, path: Path) -> Recording:
    """Time, current and potential in SI; rows flagged as overload are dropped; TestFileError where one is missing."""
    lines = text.splitlines()
    layout = _layout(lines)
    header = layout.cells(lines[0])
    cells = [split_name(cell) for cell in header]
    columns = recognised(cells, path, 1)
    if missing := [q for q in ("time", "current") if q not in columns]:
        raise TestFileError(path, f"no {missing[0]} column; found: {', '.join(header)}.", line=1)
    names = {q: cells[n][0] for q, n in columns.items()}
    factors = [factor(names[q], cells[n][1] or "", q, path, 1) for q, n in columns.items()]
    data = column_numbers(lines[1:], 2, layout, list(columns.values()), list(names.values()), path)
    overload = _overload([line for line in lines[1:] if line.strip()], header, layout)
    notes = (f"{overload.sum()} rows flagged as current overload dropped.",) if overload.any() else ()
    if overload.all():
        raise TestFileError(path, "every row is flagged as current overload. Measure again in a wider current range.")
    data = data[~overload]
    if np.any(np.diff(data[:, list(columns).index("time")]) < 0):
        raise TestFileError(path, "the time runs backwards.")
    return Recording(paths=(path,), vendor="nova", names=names, first_line=2, notes=notes,
                     columns={q: data[:, k] * factors[k] for k, q in enumerate(columns)},
                     units={q: cells[n][1] or "" for q, n in columns.items()})


def _layout(lines: list[str]) -> Layout:
    """The layout of a NOVA table: separator from the head, decimal mark from the first row."""
    delimiter = next((d for d in (";", "\t", ",") if d in lines[0]), None)
    comma = delimiter != "," and len(lines) > 1 and "," in lines[1]
    return next(x for x in LAYOUTS if x.delimiter == delimiter and x.decimal == ("," if comma else "."))


def _overload(rows: list[str], header: list[str], layout: Layout) -> np.ndarray:
    at = next((n for n, name in enumerate(header) if name.lower() == "overload"), None)
    if at is None:
        return np.zeros(len(rows), dtype=bool)
    return np.array(["overload" in layout.cells(row)[at].lower() for row in rows])
