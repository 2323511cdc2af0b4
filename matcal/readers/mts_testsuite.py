"""MTS TestSuite text exports: a head of `Key: value` lines, names, units, tab-separated numbers, perhaps in parts.

A test may be split over `... (Timed).txt`, `... (Timed)1.txt` and so on, not in order of time; a part may hold nothing.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from matcal.errors import TestFileError
from matcal.readers.recording import Array, Recording
from matcal.readers.table import Layout, column_numbers, factor, recognised

_LAYOUT = Layout("\t", ".")


def is_testsuite(text: str) -> bool:
    """Whether a text begins as TestSuite exports do."""
    return text.startswith("File Path:") or re.match(r"(Test|Test Run|Date): .*\n", text) is not None


def read_testsuite(text: str, path: Path) -> Recording:
    """One part of a TestSuite export, in SI; TestFileError where names, units or numbers are not as expected."""
    lines = text.splitlines()
    metadata, start = {}, 0
    while start < len(lines) and "\t" not in lines[start]:
        key, colon, value = lines[start].partition(":")
        if colon:
            metadata[key.strip()] = value.strip()
        start += 1
    if start + 2 >= len(lines):
        raise TestFileError(path, "a TestSuite head without numbers below it. Export the test again.", line=len(lines))
    names, units = _LAYOUT.cells(lines[start]), _LAYOUT.cells(lines[start + 1])
    if len(units) < len(names) or any(_LAYOUT.number(cell) is not None for cell in units if cell):
        raise TestFileError(path, "no line of units (such as mm, N, sec) below the column names.", line=start + 2)
    columns = recognised([(name, None) for name in names], path, start + 1)
    if len(columns) < 2:
        raise TestFileError(path, f"of the columns {', '.join(names)} fewer than two are known; expected Crosshead, "
                                  "Load and Time.", line=start + 1)
    factors = [factor(names[n], units[n], q, path, start + 2) for q, n in columns.items()]
    found = {q: names[n] for q, n in columns.items()}
    data = column_numbers(lines[start + 2:], start + 3, _LAYOUT, list(columns.values()), list(found.values()), path)
    notes = [f"column '{n}' left out: not a known quantity." for n in names if n and n not in found.values()]
    return Recording(paths=(path,), vendor="mts_testsuite", names=found, metadata=metadata, first_line=start + 3,
                     columns={q: data[:, k] * factors[k] for k, q in enumerate(columns)},
                     units={q: units[n] for q, n in columns.items()}, notes=tuple(notes))


def sibling_parts(path: Path) -> list[Path]:
    """The files beside `path` whose names differ from it only in the number that TestSuite puts behind `(Timed)`."""
    found = re.fullmatch(r"(.*\(Timed\))\d*", path.stem)
    if found is None or not path.exists():
        return [path]
    pattern = re.compile(re.escape(found[1]) + r"\d*" + re.escape(path.suffix))
    return sorted(other for other in path.parent.iterdir() if pattern.fullmatch(other.name))


def join_parts(parts: Sequence[Recording], empty: Sequence[Path] = ()) -> Recording:
    """The parts of one test as one recording in order of time; TestFileError where they are of different tests."""
    first, *others = parts
    for other in others:
        for key in ("Test", "Test Run", "Date"):
            if other.metadata.get(key) != first.metadata.get(key):
                raise TestFileError(other.paths[0], f"'{key}: {other.metadata.get(key)}' is not that of "
                                                    f"{first.paths[0].name}, '{first.metadata.get(key)}', so they are "
                                                    "not parts of one test. Keep each test in a folder of its own.")
        if other.names != first.names:
            raise TestFileError(other.paths[0], f"its columns differ from those of {first.paths[0].name}.")
    if others and "time" not in first.columns:
        raise TestFileError(first.paths[0], "parts of a test can only be put in order by a Time column.")
    ordered = sorted(parts, key=lambda part: part.columns["time"][0]) if others else list(parts)
    columns = {q: np.concatenate([part.columns[q] for part in ordered]) for q in first.columns}
    _check_order(columns, ordered)
    notes = list(dict.fromkeys(note for part in ordered for note in part.notes))
    if others:
        notes.append(f"{len(ordered)} parts joined in order of time.")
    notes += [f"{path.name} holds nothing and was left out." for path in empty]
    return Recording(paths=tuple(part.paths[0] for part in ordered), vendor=first.vendor, columns=columns,
                     names=first.names, units=first.units, first_line=ordered[0].first_line,
                     metadata=ordered[0].metadata, notes=tuple(notes))


def _check_order(columns: dict[str, Array], ordered: Sequence[Recording]) -> None:
    for before, after in pairwise(ordered):
        if after.columns["time"][0] <= before.columns["time"][-1]:
            raise TestFileError(after.paths[0], f"it starts at {after.columns['time'][0]:g} s, before "
                                                f"{before.paths[0].name} ends at {before.columns['time'][-1]:g} s. "
                                                "One of them is there twice.")
    if "time" in columns and np.any(np.diff(columns["time"]) < 0):
        raise TestFileError(ordered[0].paths[0], "the time runs backwards.")
