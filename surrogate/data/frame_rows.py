"""Lines of voltages as frames: one form for files and for streams, in which a line that is no frame costs no other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BufferedIOBase
from itertools import dropwhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.frames import LEADING, column_order, own_names
from eitsim.sensors.formats.open_file import is_board_file, open_recording
from eitsim.sensors.formats.serial_magnitudes import labelled
from eitsim.sensors.recording import in_phase
from touchcal.arrays import Array, Index
from touchcal.csv_numbers import is_numeric, with_commas
from touchcal.errors import InputFileError
from touchcal.input_file import regular

# Its number, from 1, and its text
Line = tuple[int, str]

STREAM = "the input"  # what messages call a stream
# Most lines that are answered together: those that wait already, so that none waits for another to come.
BATCH = 32
CHUNK = 1 << 20  # bytes that are read at a time, at most
LONGEST = 1 << 20  # bytes of a line without an end from which it is no frame, whatever is still to come of it


@dataclass(frozen=True, eq=False)
class Columns:
    """Where the readings stand in a line."""

    place: Index  # (readings,) column of each, from 0
    count: int  # columns of a line
    names: tuple[str, ...] = ()  # (readings,) of their own, where they have any


def in_order(readings: int) -> Columns:
    """Lines that hold the readings alone, in their order."""
    return Columns(np.arange(readings), readings)


@dataclass(frozen=True)
class Lines:
    """Lines of some frames."""

    line: NDArray[np.int64]  # (n,) number of each line, from 1
    volts: Array  # (n, readings) V, NaN for a cell that holds no number, and for a line that is no frame
    problem: list[str]  # (n,) why a line is no frame, empty where it is one
    columns: tuple[str, ...] = ()  # (readings,) their own names, where a header states any

    def after_first(self) -> Lines:
        """All but the first."""
        return Lines(self.line[1:], self.volts[1:], self.problem[1:], self.columns)


def waiting_lines(source: BufferedIOBase, most: int = BATCH) -> Iterator[list[Line]]:
    """Lists of whole lines, numbered from 1, as they come: at most `most`, and never one that another waits for. Of a
    line that does not end within LONGEST bytes, the first ones."""
    rest, number, cut = b"", 0, False
    while chunk := source.read1(CHUNK):
        if cut:
            _, end, chunk = chunk.partition(b"\n")
            cut = not end
        *whole, rest = (rest + chunk).split(b"\n")
        if len(rest) > LONGEST:
            whole, rest, cut = [*whole, rest[:LONGEST]], b"", True
        for first in range(0, len(whole), most):
            part = whole[first:first + most]
            yield [(number + i, text_of(line)) for i, line in enumerate(part, start=1)]
            number += len(part)
    if rest:
        yield [(number + 1, text_of(rest))]


def frames_as_they_come(source: BufferedIOBase, readings: int) -> Iterator[Lines]:
    """Frames of a stream, no blank lines, those together that wait already. What a program says before its first frame
    is left out, but a header. Where the first frame has the label of a board (`magnitudes : v,v,...`), lines that are
    no frame are left out too; where it has none, a line with the label is no frame. ValueError for a header of other
    names."""
    columns: Columns | None = None
    board: bool | None = None  # whether frames are labelled, as the first one is
    for some in waiting_lines(source):
        lines = [line for line in some if line[1]]
        if board is None:
            board = next((labelled(text) is not None for _, text in lines if _is_frame(text, readings)), None)
        if board:
            lines = [(number, text if values is None else values) for number, text in lines
                     if (values := labelled(text)) is not None or _is_frame(text, readings)]
        if columns is None:
            lines = list(dropwhile(lambda line: _is_banner(line[1], readings), lines))
        if lines and columns is None:
            number, text = lines[0]
            try:
                named = header_of(text, readings)
            except ValueError as error:
                raise ValueError(f"{STREAM}, line {number}: {error}") from None
            columns, lines = (in_order(readings), lines) if named is None else (named, lines[1:])
        if lines and columns is not None:
            yield frames_of(lines, in_order(readings) if board else columns)


def _is_frame(text: str, readings: int) -> bool:
    """Whether a line holds as many numbers as there are readings, labelled or not."""
    cells = _cells(labelled(text) or text, readings)
    return len(cells) == readings and all(is_numeric(cell) for cell in cells)


def _cells(text: str, count: int) -> list[str]:
    """The cells of a line, without the comma behind `count` of them that loops print."""
    cells = text.split(",")
    return cells[:-1] if len(cells) == count + 1 and not cells[-1].strip() else cells


def _is_banner(text: str, readings: int) -> bool:
    """Whether a line holds words that are no header: too few to name all readings, and none of a reading first."""
    first, *others = (cell.strip().strip('"') for cell in text.split(","))
    return len(others) + 1 < readings and bool(first) and not is_numeric(first) and not first.startswith("v_")


def text_of(line: bytes) -> str:
    """A line without its end, whatever its bytes are, with commas between its cells."""
    return with_commas(line.decode("utf-8-sig", errors="replace").strip())


def header_of(text: str, readings: int) -> Columns | None:
    """The columns of lines by a header that names readings v_000 ... and may name those of a recording; None where the
    line is no header, as one that holds a number, of which the beginning may be cut. ValueError for a header of other
    names."""
    names = [cell.strip().strip('"') for cell in text.split(",")]
    if not names[0] or any(map(is_numeric, names)):
        return None
    place = column_order(names, readings)
    return Columns(place, len(names), own_names([names[column] for column in place.tolist()]))


def frame_of(text: str, columns: Columns) -> Array:
    """(readings,) V of a line of these columns, NaN for an empty cell; ValueError where it is none."""
    cells = _cells(text, columns.count)
    if len(cells) != columns.count:
        more = 0 < len(cells) - columns.count <= len(LEADING)
        raise ValueError(f"{len(cells)} columns, expected {columns.count} voltages separated by commas"
                         + "; a header can name a clock too: time_s, v_000, v_001 ..." * more)
    places = columns.place.tolist()
    try:
        return np.array([float(cells[k]) for k in places])
    except ValueError:
        return np.array([_number(k + 1, cells[k]) for k in places])


def _number(column: int, cell: str) -> float:
    try:
        return float(cell.strip() or "nan")
    except ValueError:
        raise ValueError(f"column {column} holds {cell.strip()[:20]!a} and no number") from None


def frames_of(lines: Sequence[Line], columns: Columns) -> Lines:
    """The frames of some lines of these columns."""
    volts, problem = np.full((len(lines), len(columns.place)), np.nan), [""] * len(lines)
    for k, (_, text) in enumerate(lines):
        try:
            volts[k] = frame_of(text, columns)
        except ValueError as error:
            problem[k] = f"unreadable: {error}"
    return Lines(np.array([number for number, _ in lines], np.int64), volts, problem, columns.names)


def read_lines(path: Path, readings: int) -> Lines:
    """All frames of a CSV, without blank lines, or of a board's file, by their numbers from 1; InputFileError where it
    holds none, or a header of other names."""
    if is_board_file(path):
        volts = in_phase(open_recording(path, readings=readings).readings)
        return Lines(np.arange(1, len(volts) + 1), volts, [""] * len(volts))
    with open(regular(path), "rb") as file:
        lines = [line for some in waiting_lines(file) for line in some if line[1]]
    try:
        named = header_of(lines[0][1], readings) if lines else None
    except ValueError as error:
        raise InputFileError(path, str(error), line=lines[0][0]) from None
    found = frames_of(lines, in_order(readings)) if named is None else frames_of(lines[1:], named)
    if not len(found.line):
        raise InputFileError(path, f"it holds no frame. Expected rows of {readings} voltages, the untouched one first "
                                   "or in a file for `baseline`.")
    if all(found.problem):
        raise InputFileError(path, f"{found.problem[0]}; no line of it is a frame.", line=int(found.line[0]))
    return found


def sound_lines(path: Path, readings: int) -> Array:
    """(n, readings) V of a file all of whose lines are frames; InputFileError names the first that is none."""
    read = read_lines(path, readings)
    for line, problem in zip(read.line.tolist(), read.problem, strict=True):
        if problem:
            raise InputFileError(path, f"{problem}. Fix it, or leave the line out.", line=line)
    return read.volts


def first_frame(lines: Lines, where: str) -> Array:
    """(readings,) V of the first line, as the untouched frame; ValueError where it is none."""
    if lines.problem[0]:
        raise ValueError(f"{where}, line {lines.line[0]}: {lines.problem[0]}. The first frame is the untouched one: "
                         "fix it, or give `baseline` FILE.")
    return lines.volts[0]
