"""MTS TestSuite text exports: a head of `Key: value` lines, names, units, tab-separated numbers, perhaps in parts.

A test may be split over `... (Timed).txt`, `... (Timed)1.txt` and so on, not in order of time; a part may hold nothing.
"""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from matcal.readers.cells import text_grid
from matcal.readers.column_options import Selection
from matcal.readers.columns import Header, read_columns
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from touchcal.errors import InputFileError


def _is_testsuite(source: Source) -> bool:
    return re.match(r"(File Path|Test|Test Run|Date):", source.text) is not None and "\t" in source.text


def _read_testsuite(source: Source, selection: Selection | None = None) -> Recording:
    path, grid = source.path, text_grid(source.text, source.path, "\t")
    start = next((n for n, row in enumerate(grid.rows) if len(row) > 1), len(grid.rows))
    if start + 2 >= len(grid.rows):
        raise InputFileError(path, "a TestSuite head without numbers below it. Export the test again.",
                             line=grid.lines[-1])
    names, units = grid.rows[start], grid.rows[start + 1]
    if len(units) < len(names) or grid.numeric(units):
        raise InputFileError(path, "no line of units (such as mm, N, sec) below the column names.",
                             line=grid.lines[start + 1])
    metadata = {}
    for row in grid.rows[:start]:
        key, colon, value = row[0].partition(":")
        if colon:
            metadata[key.strip()] = value.strip()
    header = Header(list(zip(names, units, strict=False)), grid.lines[start + 1], range(start + 2, len(grid.rows)))
    return read_columns(grid, header, "mts_testsuite", selection, metadata=metadata)


def sibling_parts(path: Path) -> list[Path]:
    """The files next to `path` whose names differ from it only in the number that TestSuite puts behind `(Timed)`."""
    found = re.fullmatch(r"(.*\(Timed\))\d*", path.stem)
    if found is None or not path.exists():
        return [path]
    pattern = re.compile(re.escape(found[1]) + r"\d*" + re.escape(path.suffix))
    return sorted(other for other in path.parent.iterdir() if pattern.fullmatch(other.name))


def join_parts(parts: Sequence[Recording], empty: Sequence[Path] = ()) -> Recording:
    """The parts of one test as one recording in order of time; InputFileError where they are of different tests."""
    first, *others = parts
    for other in others:
        for key in ("Test", "Test Run", "Date"):
            if other.metadata.get(key) != first.metadata.get(key):
                raise InputFileError(other.paths[0], f"'{key}: {other.metadata.get(key)}' is not that of "
                                                     f"{first.paths[0].name}, '{first.metadata.get(key)}', so they are "
                                                     "not parts of one test. Keep each test in a folder of its own.")
        if other.names != first.names:
            raise InputFileError(other.paths[0], f"its columns differ from those of {first.paths[0].name}.")
    if others and "time" not in first.columns:
        raise InputFileError(first.paths[0], "parts of a test can only be put in order by a Time column.")
    ordered = sorted(parts, key=lambda part: part.columns["time"][0]) if others else list(parts)
    _check_overlap(ordered)
    columns = {q: np.concatenate([part.columns[q] for part in ordered]) for q in first.columns}
    notes = list(dict.fromkeys(note for part in ordered for note in part.notes))
    if others:
        notes.append(f"{len(ordered)} parts joined in order of time.")
    notes += [f"{path.name} holds nothing and was left out." for path in empty]
    return Recording(paths=tuple(part.paths[0] for part in ordered), vendor=first.vendor, columns=columns,
                     names=first.names, units=first.units, first_line=ordered[0].first_line,
                     metadata=ordered[0].metadata, notes=tuple(notes))


def _check_overlap(ordered: Sequence[Recording]) -> None:
    for before, after in pairwise(ordered):
        if after.columns["time"][0] <= before.columns["time"][-1]:
            raise InputFileError(after.paths[0], f"it starts at {after.columns['time'][0]:g} s, before "
                                                 f"{before.paths[0].name} ends at {before.columns['time'][-1]:g} s. "
                                                 "One of them is there twice.")


READER = Reader("mts_testsuite", "MTS TestSuite text export", _is_testsuite, _read_testsuite)
