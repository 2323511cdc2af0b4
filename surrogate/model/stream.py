"""Frames line by line, each answered as soon as it is there."""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BufferedIOBase
from typing import TextIO

import numpy as np

from surrogate.data.baseline_frame import compared
from surrogate.data.dead_readings import SaidOnce
from surrogate.data.frame_rows import STREAM, Lines, first_frame, frames_as_they_come
from surrogate.data.reading_noise import ReadingNoise, white_noise
from surrogate.model import sticking
from surrogate.model.missing_channels import check_enough, cost_words, silent
from surrogate.model.predict import (
    Predictions,
    Predictor,
    columns,
    dead_in,
    numbers_of,
    prepare,
    read_touches,
    sign_caution,
)
from surrogate.model.sticking import Runs
from surrogate.model.sweep_model import SweepModel
from surrogate.model.trained import TrainedModel
from touchcal.arrays import Array, Mask


@dataclass(frozen=True)
class Counts:
    """Frames that a stream held."""

    answered: int
    flagged: int


def answer(model: SweepModel, source: BufferedIOBase, sink: TextIO, noise: ReadingNoise | float,
           baseline_V: Array | None = None, dead: Mask | None = None,
           say: Callable[[str], object] = lambda words: None, *, scaling: str = "auto",
           held_s: float | None = None) -> Counts:
    """Write one row of predictions for each frame of a stream, flushed as soon as no further one waits.

    baseline_V (readings,), V, is the untouched frame, and dead (readings,) its dead channels; without, the first frame
    is the untouched one and has no row; scaling is that of `baseline_frame.compared`, held_s as in `prepare`. `say`
    takes words on that, on an untouched frame of elsewhere, on dead channels and on the first signals of the other
    sign. A line that is no frame has a row without values whose flag tells why; the stream goes on. ValueError where
    the untouched frame is bad or there is none, or a header names anything but readings.
    """
    known = noise if isinstance(noise, ReadingNoise) else white_noise(noise, len(model.baseline_V))
    table = csv.writer(sink, lineterminator="\n")
    table.writerow(columns(model))
    sink.flush()

    def by(untouched_V: Array) -> tuple[Predictor, Array]:
        found = compared(model.baseline_V, model.ring, untouched_V, known.rms_V, scaling)
        if found.words:
            say(found.words)
        return (prepare(model, untouched_V * found.gain, known.scaled(found.gain), dead, held_s=held_s), found.gain)

    ready = None if baseline_V is None else by(baseline_V)
    answered, flagged, warned = 0, 0, False
    runs = sticking.begun(len(model.baseline_V))
    lost = SaidOnce(lambda dead, columns: cost_words(model, dead, known, columns), say)
    for read in frames_as_they_come(source, len(model.baseline_V)):
        if ready is None:
            ready, read = by(_untouched(model, read, say)), read.after_first()
        if len(read.line):
            lost.columns = read.columns
            runs, volts = _without_stuck(runs, read)
            read = replace(read, volts=volts)
            found = read_touches(ready[0], replace(read, volts=read.volts * ready[1]))
            rows = rows_of(model, read, found)
            table.writerows(rows)
            sink.flush()
            answered, flagged = answered + len(rows), flagged + sum(map(bool, found.flag))
            for dead_now, problem in zip(dead_in(ready[0], read.volts), read.problem, strict=True):
                if not problem:
                    lost.met(dead_now)
            if not warned and (words := sign_caution(found.kinds)):
                say(f"line {rows[0][0]} on: {words}")
                warned = True
    if ready is None:
        raise ValueError(f"{STREAM} held no frame. Give the untouched one first, or `baseline` FILE.")
    return Counts(answered, flagged)


def _without_stuck(runs: Runs, lines: Lines) -> tuple[Runs, Array]:
    """What is known of channels after some more lines, and these, V, NaN where a channel sticks."""
    volts = lines.volts.copy()
    for frame, problem in zip(volts, lines.problem, strict=True):
        if not problem:
            runs = sticking.followed(runs, frame.copy())
            frame[runs.sticking()] = np.nan
    return runs, volts


def _untouched(model: SweepModel, lines: Lines, say: Callable[[str], object]) -> Array:
    """The first line, V, with words on it."""
    volts, where = first_frame(lines, STREAM), f"{STREAM}, line {lines.line[0]}"
    check_enough(silent(volts[None], model.baseline_V)[0], where)
    say(f"{where} is taken as the untouched frame; give --baseline FILE where it is not.")
    return volts


def rows_of(model: TrainedModel, lines: Lines, found: Predictions) -> list[list[str]]:
    """Rows of predictions of some lines, in their order."""
    numbers = numbers_of(model, found).tolist()
    return [[str(number), *("" if math.isnan(value) else f"{value:.6g}" for value in values), flag]
            for number, values, flag in zip(lines.line.tolist(), numbers, found.flag, strict=True)]
