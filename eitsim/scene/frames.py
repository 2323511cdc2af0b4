"""Frames of voltages as a CSV: one column a reading, pattern-major, one row a frame, header optional; a recording's
other columns are left out."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.drive import voltage_columns
from eitsim.scene.results import Readings
from touchcal.arrays import Array
from touchcal.csv_numbers import read_numbers, write_numbers
from touchcal.errors import InputFileError

LEADING = ("index", "time_s", "touch")  # columns of a recording that are no readings


@dataclass(frozen=True)
class Frames:
    """Frames and where they stand in their file."""

    volts: Array  # (n, readings) V; NaN where a cell is empty: the reading was not measured
    line: NDArray[np.int64]  # (n,) line numbers from 1


def read_frames(path: Path | str, readings: int) -> Frames:
    """Read a file of frames, columns v_000 ... in any order where a header names them, else in that order, without
    those of LEADING. InputFileError names the line of a wrong width or a cell that is no number, and a header's name
    that is no reading."""
    table = read_numbers(path, readings, what="voltages", blanks=True, left_out=LEADING)
    volts = table.values
    if table.names:
        try:
            volts = volts[:, column_order(table.names, readings)]
        except ValueError as error:
            raise InputFileError(path, f"{error}") from None
    return Frames(volts, table.line)


def numbered(names: Sequence[str]) -> list[str]:
    """A header with v_000 ... for readings that it numbers from 0 or 1 under one word of its own, each once: ch1, ch2.

    >>> numbered(["touch", "ch1", "ch2"])
    ['touch', 'v_000', 'v_001']
    >>> numbered(["ch1", "ch3"])
    ['ch1', 'ch3']
    """
    found = {name: re.fullmatch(r"(.*\D)(\d+)", name) for name in names if name not in LEADING}
    place = {name: int(match[2]) for name, match in found.items() if match}
    first = min(place.values(), default=0)
    words = {match[1] for match in found.values() if match}
    if (len(place) < len(found) or len(words) != 1 or first > 1 or words == {"v_"}
            or sorted(place.values()) != list(range(first, first + len(place)))):
        return list(names)
    own = dict(zip(sorted(place, key=lambda name: place[name]), voltage_columns(len(place)), strict=True))
    return [own.get(name, name) for name in names]


def own_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names of readings in their order, where they are others than v_000 ...; else none."""
    return () if [*names] == voltage_columns(len(names)) else tuple(names)


def column_order(names: Sequence[str], readings: int) -> NDArray[np.intp]:
    """(readings,) column of each reading under a header that names v_000 ..., or readings of one word (`numbered`), in
    any order; ValueError for one that names anything else but LEADING, or not each of them once."""
    given, names = list(names), numbered(names)
    requested = voltage_columns(readings)
    place = {name: column for column, name in enumerate(names)}
    fix = f"Name the columns {requested[0]} to {requested[-1]}, or leave the header out where they are in that order."
    if names[0].startswith("{"):
        raise ValueError("this is JSON; frames are rows of a CSV, as `eitsim run SCENE --frames FILE` writes them.")
    if foreign := [name for name in place if name not in (*requested, *LEADING)]:
        column = place[foreign[0]]
        raise ValueError(f"the header names '{given[column][:20]}' in column {column + 1}, which is no reading. {fix}")
    if given != names and len(set(requested) & set(names)) < readings:
        own = [word for word, name in zip(given, names, strict=True) if word != name]
        raise ValueError(f"the header names {len(own)} readings, '{own[0][:20]}' to '{own[-1][:20]}', and {readings} "
                         f"are expected. {fix}")
    if lacking := [name for name in requested if name not in place]:
        raise ValueError(f"the header lacks {lacking[0]}. {fix}")
    if len(place) < len(names):
        twice = next(name for column, name in enumerate(names) if place[name] != column)
        raise ValueError(f"the header names {twice} twice. {fix}")
    return np.array([place[name] for name in requested], np.intp)


def write_frames(path: Path | str, frames: Sequence[Readings]) -> None:
    """Write solved readings as frames that `read_frames` and `surrogate predict` read: the untouched one first, then
    one a solution, columns v_000 ... in the order of the drive pattern, V, empty where an electrode is missing."""
    volts = np.array([frames[0].baseline_V.ravel(), *(frame.touched_V.ravel() for frame in frames)])
    write_numbers(path, voltage_columns(volts.shape[1]), volts)
