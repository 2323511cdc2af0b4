"""Plain tables: a line of names, perhaps a line of units, then numbers; CSV, semicolons, tabs or blanks."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from matcal.errors import TestFileError
from matcal.readers.recording import Array, Recording
from matcal.readers.table import Layout, column_numbers, factor, recognised, sniff
from matcal.readers.units import quantity_of, split_name

_EXPECTED = "strain and stress, or displacement and force (and time)"
_EXAMPLE = "for example strain,stress and below it -,kPa"
# beyond this a strain without a unit may as well be a percentage
_LARGEST_STRAIN = 3.0


def read_plain(text: str, path: Path) -> Recording:
    """A plain table; TestFileError where names or units are missing, or a cell is no finite number."""
    lines = text.splitlines()
    layout = sniff(lines)
    if layout is None:
        raise TestFileError(path, "no table of numbers in two or more columns was found. Expected a line of names such "
                                  "as strain,stress, a line of units such as -,kPa, then the numbers.")
    first, above = _header(lines, layout, path)
    line, cells = _names_and_units(above, layout, path)
    columns = recognised(cells, path, line)
    if len(columns) < 2:
        found = ", ".join(f"'{name}'" for name, _ in cells)
        raise TestFileError(path, f"of the columns {found} fewer than two are known by name. Name them {_EXPECTED}, "
                                  f"with a line of units below, {_EXAMPLE}.", line=line)
    names = {q: cells[n][0] for q, n in columns.items()}
    units = {q: cells[n][1] or "" for q, n in columns.items()}
    factors = [factor(names[q], units[q], q, path, line) for q in columns]
    data = column_numbers(lines[first:], first + 1, layout, list(columns.values()), list(names.values()), path)
    values = {q: data[:, k] * factors[k] for k, q in enumerate(columns)}
    notes = [f"column '{name}' left out: not a known quantity." for name, _ in cells if quantity_of(name) is None]
    notes += _measure(values, names, units, path, line)
    notes += [f"its own comment: '{text}'." for text in _comments(lines[:first])]
    return Recording(paths=(path,), vendor="plain", columns=values, names=names, units=units, first_line=first + 1,
                     notes=tuple(notes))


def _comments(lines: list[str]) -> list[str]:
    return [line.strip().lstrip("# ").rstrip(",; ") for line in lines if line.lstrip().startswith("#")]


def _header(lines: list[str], layout: Layout, path: Path) -> tuple[int, list[tuple[int, str]]]:
    """(index of the first row of numbers, the (line, text) pairs above it)."""
    first = next(n for n, line in enumerate(lines)
                 if sum(layout.number(c) is not None for c in layout.cells(line)) > 1)
    above = [(n, line) for n, line in enumerate(lines[:first], 1) if line.strip() and not line.lstrip().startswith("#")]
    if not above:
        raise TestFileError(path, "no line of column names stands above the numbers, so the columns cannot be told "
                                  f"apart. Name them {_EXPECTED}, {_EXAMPLE}.", line=1)
    return first, above


def _names_and_units(above: list[tuple[int, str]], layout: Layout,
                     path: Path) -> tuple[int, list[tuple[str, str | None]]]:
    """The line that names the columns (or that of their units) and (name, unit or None) of each."""
    rows = [(line, layout.cells(text)) for line, text in above]
    known = [k for k, (_, cells) in enumerate(rows) if sum(bool(quantity_of(split_name(c)[0])) for c in cells) > 1]
    at = known[-1] if known else 0
    line, cells = rows[at]
    named = [split_name(cell) for cell in cells]
    if at + 1 == len(rows):
        return line, named
    line, units = rows[at + 1]
    if len(units) < len(named):
        raise TestFileError(path, f"the line of units has {len(units)} cells, that of names {len(named)}.", line=line)
    return line, [(name, units[n].strip("()[]") if unit is None else unit) for n, (name, unit) in enumerate(named)]


def _measure(values: dict[str, Array], names: dict[str, str], units: dict[str, str], path: Path,
             line: int) -> list[str]:
    """Notes on strain and stretch; a "stretch" below 0 becomes a strain, an incredible strain is refused."""
    notes = []
    if "stretch" in values and "strain" not in values and np.any(values["stretch"] <= 0):
        notes.append(f"column '{names['stretch']}' has values at or below 0, which no stretch has: read as strain.")
        for table in (values, names, units):
            table["strain"] = table.pop("stretch")  # type: ignore[assignment]
    for q in {"strain", "stretch"} & set(values):
        if units[q] == "":
            if np.max(np.abs(values[q])) > _LARGEST_STRAIN:
                raise TestFileError(path, f"column '{names[q]}' reaches {np.max(np.abs(values[q])):g} and has no unit. "
                                          "Write its unit, % or -, below its name.", line=line)
            notes.append(f"column '{names[q]}' has no unit: read as a plain ratio.")
    return notes
