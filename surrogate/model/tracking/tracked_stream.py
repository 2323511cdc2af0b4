"""Frames line by line through a tracker: one line in, one row out, flushed at once."""

import csv
import math
from collections.abc import Callable, Sequence
from io import BufferedIOBase
from typing import TextIO

from surrogate.data.frame_rows import STREAM, frames_as_they_come
from surrogate.model.predict import sign_caution
from surrogate.model.stream import Counts
from surrogate.model.tracking.tracked import CALIBRATING, UNREADABLE, UNTOUCHED
from surrogate.model.tracking.tracker import Tracker
from touchcal.arrays import Array

QUIET = (CALIBRATING, UNTOUCHED)  # states whose flags count no frame as flagged


def track(tracker: Tracker, source: BufferedIOBase, sink: TextIO,
          say: Callable[[str], object] = lambda words: None) -> Counts:
    """Write one row for each line of a stream, flushed as soon as it is known.

    A line that is no frame has a row without values whose flag tells why; the stream goes on, and the tracker's clock
    stands still for it. `say` takes words on the calibration, on the first line that is no frame, and on
    the first signals of the other sign. ValueError where a header names anything but readings, or there is no frame.
    """
    table, values_there = csv.writer(sink, lineterminator="\n"), len(tracker.columns)
    table.writerow(["line", *tracker.columns, "state", "flag"])
    sink.flush()
    answered = flagged = 0
    warned = calibrating = unreadable = False
    for read in frames_as_they_come(source, tracker.readings):
        tracker.named_by(read.columns)
        for line, volts, problem in zip(read.line.tolist(), read.volts, read.problem, strict=True):
            state, values, flag, kinds = (UNREADABLE, None, problem, 0) if problem else _answer(tracker, volts)
            table.writerow([line, *(_cell(value) for value in values or [math.nan] * values_there), state, flag])
            sink.flush()
            answered, flagged = answered + 1, flagged + (bool(flag) and state not in QUIET)
            calibrating = _say_calibrating(tracker, state, calibrating, say)
            if state == UNREADABLE and not unreadable:
                say(f"line {line}: {flag}. Such lines have rows without values; this is said once.")
                unreadable = True
            if not warned and (words := sign_caution([kinds])):
                say(f"line {line} on: {words}")
                warned = True
    if not answered:
        raise ValueError(f"{STREAM} held no frame. Give the untouched ones first, or `baseline` FILE.")
    return Counts(answered, flagged)


def _cell(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def _answer(tracker: Tracker, volts: Array) -> tuple[str, Sequence[float] | None, str, int]:
    """State, values or none, flag of a frame, and its kinds."""
    said = tracker.update(volts)
    return said.state, None if said.row is None else said.row.tolist(), said.flag, said.kinds


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
