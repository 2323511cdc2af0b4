"""Frames line by line, each answered as soon as it is there."""

from __future__ import annotations

import contextlib
import csv
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from io import BufferedIOBase
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from eitsim.dataset import voltage_columns
from surrogate.model import Model
from surrogate.predict import Predictor, baseline_caution, columns, numbers_of, predict, prepare

Array = NDArray[np.float64]
Line = tuple[int, str]

# Most lines that are answered together: those that wait already, so that none waits for another to come.
BATCH = 32
# Bytes that are read at a time, at most.
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Counts:
    """Frames that a stream held."""

    answered: int
    flagged: int


def waiting_lines(source: BufferedIOBase, most: int = BATCH) -> Iterator[list[Line]]:
    """Lists of whole lines, numbered from 1, as they come: at most `most`, and never one that another waits for."""
    rest, number = b"", 0
    while chunk := source.read1(_CHUNK):
        *whole, rest = (rest + chunk).split(b"\n")
        for first in range(0, len(whole), most):
            part = whole[first:first + most]
            yield [(number + i, _text(line)) for i, line in enumerate(part, start=1)]
            number += len(part)
    if rest:
        yield [(number + 1, _text(rest))]


def widen_pipe(descriptor: int) -> None:
    """Let a pipe hold more frames than its 64 kB, where the system can, so that a fast writer's are answered together.
    """
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, _CHUNK)  # pyright: ignore[reportAttributeAccessIssue]


def _text(line: bytes) -> str:
    return line.decode("utf-8-sig", errors="replace").strip()


@dataclass(frozen=True)
class Columns:
    """The columns of a stream."""

    # readings in a frame
    count: int
    # (readings,) place of each reading in a line
    order: NDArray[np.intp]


def header_of(text: str, readings: int) -> Columns | None:
    """The columns that a header names, in any order where they are v_000 ...; None where the line is no header."""
    names = [cell.strip() for cell in text.split(",")]
    try:
        float(names[0] or "nan")
    except ValueError:
        wanted = voltage_columns(readings)
        order = [names.index(name) for name in wanted] if set(wanted) == set(names) else range(readings)
        return Columns(readings, np.array(order, np.intp))
    return None


def frame_of(text: str, form: Columns) -> Array:
    """(readings,) V of a line, NaN for an empty cell; ValueError says what is wrong with it."""
    cells = text.split(",")
    if len(cells) != form.count:
        raise ValueError(f"{len(cells)} columns, expected {form.count} voltages")
    try:
        volts = np.array(list(map(float, cells)))
    except ValueError:
        volts = np.array([_number(column, cell) for column, cell in enumerate(cells, start=1)])
    return volts[form.order]


def _number(column: int, cell: str) -> float:
    try:
        return float(cell.strip() or "nan")
    except ValueError:
        raise ValueError(f"column {column} holds '{cell.strip()[:20]}' and no number") from None


def answer(model: Model, source: BufferedIOBase, sink: TextIO, noise_V: float,
           baseline_V: Array | None = None, caution: Callable[[str], object] = lambda words: None) -> Counts:
    """Write one row of predictions for each frame of a stream, flushed as soon as no further one waits.

    Without baseline_V (readings,), V, the first frame is the untouched one and has no row; `caution` takes words on
    one of elsewhere. A line that is no frame has a row without values whose flag tells why; the stream goes on.
    ValueError where the untouched frame is bad or there is none.
    """
    table = csv.writer(sink, lineterminator="\n")
    table.writerow(columns(model))
    sink.flush()
    readings = len(model.baseline_V)
    form = Columns(readings, np.arange(readings))
    predictor = None if baseline_V is None else prepare(model, baseline_V, noise_V)
    headed, answered, flagged = False, 0, 0
    for lines in waiting_lines(source):
        lines = [line for line in lines if line[1]]
        if lines and not headed:
            headed, named = True, header_of(lines[0][1], readings)
            form, lines = (named, lines[1:]) if named else (form, lines)
        if lines and predictor is None:
            predictor, lines = prepare(model, _first(lines[0], form), noise_V), lines[1:]
            if words := baseline_caution(model, predictor.baseline_V):
                caution(words)
        if lines and predictor is not None:
            rows = answers(predictor, lines, form)
            table.writerows(rows)
            sink.flush()
            answered, flagged = answered + len(rows), flagged + sum(bool(row[-1]) for row in rows)
    if predictor is None:
        raise ValueError("standard input held no frame. Give the untouched one first, or --baseline FILE.")
    return Counts(answered, flagged)


def _first(line: Line, form: Columns) -> Array:
    """The untouched frame."""
    number, text = line
    try:
        return frame_of(text, form)
    except ValueError as error:
        raise ValueError(f"standard input, line {number}: {error}. The first frame is the untouched one: mend it, or "
                         "give --baseline FILE.") from None


def answers(predictor: Predictor, lines: Sequence[Line], form: Columns) -> list[list[str]]:
    """Rows of predictions of some lines, in their order."""
    volts, problems = [], {}
    for number, text in lines:
        try:
            volts.append(frame_of(text, form))
        except ValueError as error:
            problems[number] = f"unreadable: {error}"
    numbers = len(columns(predictor.model)) - 2
    found = predict(predictor, np.array(volts).reshape(-1, form.count))
    sound = iter(zip(numbers_of(found).tolist(), found.flag, strict=True))
    rows = []
    for number, _ in lines:
        values, flag = ([math.nan] * numbers, problems[number]) if number in problems else next(sound)
        rows.append([str(number), *("" if math.isnan(value) else f"{value:.6g}" for value in values), flag])
    return rows
