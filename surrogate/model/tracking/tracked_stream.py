"""Frames line by line through a tracker: one line in, one row out, flushed at once."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from io import BufferedIOBase
from typing import TextIO

from surrogate.data.frame_rows import Columns, Line, frame_of, header_of, in_order, waiting_lines
from surrogate.model import predict
from surrogate.model.stream import SOURCE, Counts
from surrogate.model.tracking import followed_presses
from surrogate.model.tracking.tracked import CALIBRATING, UNREADABLE, UNTOUCHED
from surrogate.model.tracking.tracker import Tracker
from surrogate.model.trained import TrainedModel
from surrogate.recordings.trained.train_reader import TrainedReader

QUIET = (CALIBRATING, UNTOUCHED)  # states whose flags count no frame as flagged


def columns(model: TrainedModel | TrainedReader) -> list[str]:
    """Names of the columns of rows: those of predictions, `state` before the flag."""
    each = (predict.columns(model)[1:-1] if isinstance(model, TrainedModel) else
            followed_presses.columns(model.reader))
    return ["line", *each, "state", "flag"]


def track(tracker: Tracker, model: TrainedModel | TrainedReader, source: BufferedIOBase, sink: TextIO,
          say: Callable[[str], object] = lambda words: None) -> Counts:
    """Write one row for each line of a stream, flushed as soon as it is known.

    A line that is no frame has a row without values whose flag tells why; the stream goes on, and the tracker's clock
    stands still for it. `say` takes words on the calibration and on the first signals of the other sign. ValueError
    where a header names anything but readings, or there is no frame.
    """
    table, names = csv.writer(sink, lineterminator="\n"), columns(model)
    table.writerow(names)
    sink.flush()
    order: Columns | None = None
    answered = flagged = 0
    warned = calibrating = False
    for lines in waiting_lines(source):
        for line in lines:
            if not line[1]:
                continue
            if order is None:
                named = _header(line, tracker.readings)
                order = in_order(tracker.readings) if named is None else named
                if named is not None:
                    continue
            state, values, flag = _answer(tracker, line, order)
            table.writerow([line[0], *(_cell(value) for value in values or [math.nan] * (len(names) - 3)), state, flag])
            sink.flush()
            answered, flagged = answered + 1, flagged + (bool(flag) and state not in QUIET)
            calibrating = _say_calibrating(tracker, state, calibrating, say)
            if not warned and (words := predict.sign_caution([flag])):
                say(f"line {line[0]} on: {words}")
                warned = True
    if order is None or not answered:
        raise ValueError(f"{SOURCE} held no frame. Give the untouched ones first, or --baseline FILE.")
    return Counts(answered, flagged)


def _cell(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def _header(line: Line, readings: int) -> Columns | None:
    try:
        return header_of(line[1], readings)
    except ValueError as error:
        raise ValueError(f"{SOURCE}, line {line[0]}: {error}") from None


def _answer(tracker: Tracker, line: Line, order: Columns) -> tuple[str, Sequence[float] | None, str]:
    """State, values or none, and flag of a line."""
    try:
        volts = frame_of(line[1], order)
    except ValueError as error:
        return UNREADABLE, None, f"unreadable: {error}"
    said = tracker.update(volts)
    return said.state, None if said.row is None else said.row.tolist(), said.flag


def _say_calibrating(tracker: Tracker, state: str, before: bool, say: Callable[[str], object]) -> bool:
    """Say once that the noise is being learnt and how long that takes, and once what it is."""
    if state == UNREADABLE:
        return before
    if state == CALIBRATING and not before:
        say(f"the first {tracker.calibration} frames tell the untouched frame and the noise, "
            f"{tracker.calibration / tracker.rate_hz:.2g} s at {tracker.rate_hz:g} frames a second: touch nothing. "
            "Give --baseline FILE with some untouched frames, or --noise-V VOLTS, to begin at once.")
    elif before and state != CALIBRATING:
        say(f"calibrated: the noise of a reading is {tracker.noise_V:.3g} V.")
        return False
    return state == CALIBRATING
