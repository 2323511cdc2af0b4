"""A layout of files: how one is recognised and read."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.sensors.conventions import counts_for
from eitsim.sensors.recording import Recording
from touchcal.arrays import Array, Complex, Index
from touchcal.errors import InputFileError
from touchcal.input_file import regular

FEWEST_READINGS = 16  # readings of a frame where the other axis may be the readings too


@dataclass(frozen=True)
class Layout:
    """One layout of files; `open_file.formats` names them all."""

    title: str  # what a user calls it
    recognises: Callable[[Path], bool]  # whether a file has this layout, from its name and what it holds
    read: Callable[[Path, str], Recording]  # the recording; the kind of readings where the file does not say it


def text_lines(path: Path) -> list[str]:
    """Lines of a text file, without their ends; InputFileError where it is none."""
    try:
        return regular(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"not a text file ({error}). Export it as text or CSV.") from None


def first_lines(path: Path, count: int = 40) -> list[str]:
    """The first lines of a text file; none of a folder, or of a file that is no text."""
    if not path.is_file():
        return []
    with open(path, "rb") as file:
        head = file.read(65536)
    return [] if b"\0" in head else head.decode("utf-8", errors="replace").splitlines()[:count]


def frames(path: Path, readings: Array | Complex, kind: str, pairs: Index | None = None) -> Recording:
    """A recording of frames (n, readings) one after the other that no file names the touches of; pairs (readings, 4):
    where the file states its order."""
    return Recording(readings, np.arange(len(readings)), None, np.array([""] * len(readings)), kind, path, pairs)


def a_row_a_frame(path: Path, name: str, array: Array | Complex, readings: int | None = None) -> Array | Complex:
    """(frames, readings) of an array of one or two axes, whose axis of readings is the only one of `readings` numbers,
    or without it the one of which a common drive makes so many; InputFileError where both are, or neither."""
    if array.ndim == 1:
        return array[None]
    first, second = array.shape
    if readings is not None and (first == readings) != (second == readings):
        return array.T if first == readings else array
    by_column, by_row = (size >= FEWEST_READINGS and bool(counts_for(size)) for size in array.shape)
    if by_column == by_row:
        which = ("either may be the readings of a frame." if by_row else
                 "neither is a number of readings that a common drive makes of a frame (of 16 electrodes 208, or 256 "
                 "with the driven ones): are some left out?")
        raise InputFileError(path, f"{name} is {first} x {second}, and {which} Save it as a CSV of one row a frame, or "
                                   "for MATLAB as a structure whose field meas has one column a frame, as EIDORS does.")
    return array.T if by_column else array


def equally_long(path: Path, rows: list[list[float]], lines: list[int], what: str) -> Array:
    """Rows as an array; InputFileError names the line of the first one that has not as many numbers as most."""
    widths = [len(row) for row in rows]
    usual = max(set(widths), key=widths.count)
    for width, line in zip(widths, lines, strict=True):
        if width != usual:
            raise InputFileError(path, f"{width} {what}, and most frames have {usual}: this one was cut. Delete it.",
                                 line=line)
    return np.array(rows)
