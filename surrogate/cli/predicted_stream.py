"""`surrogate predict MODEL -`: rows for frames as they come, from standard input or a serial port."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from surrogate.cli.given_frames import (
    counted_frames,
    noise_of,
    say,
    say_assumed,
    say_holding,
    say_intervals,
    untouched_of,
)
from touchcal.whole_file import rows_written

if TYPE_CHECKING:
    from surrogate.model.model import Model
    from surrogate.model.sweep_model import SweepModel

STOPPED = 130  # exit status after Ctrl-C


def predict_stream(model: SweepModel, frames: str, baseline: Path | None, noise_V: float | None, out: Path | None,
                   scaling: str, held_s: float | None) -> None:
    from contextlib import nullcontext

    from surrogate.data.baseline_frame import Untouched
    from surrogate.data.frame_source import opened
    from surrogate.model.stream import answer

    reference, dead = (None, None) if baseline is None else untouched_of(model, baseline)
    noise = noise_of(reference or Untouched(model.baseline_V, None), noise_V)
    say_intervals(model, noise)
    say_holding(model, held_s)
    say_assumed(model)
    with (_until_stopped(out), opened(frames, say) as source,
          nullcontext(sys.stdout) if out is None else rows_written(out) as sink):
        counts = answer(model, source, sink, noise, None if reference is None else reference.volts, dead, say,
                        scaling=scaling, held_s=held_s)
    if out is not None:
        print(f"{out}: {counted_frames(counts.answered, counts.flagged)}")


def track_stream(model: Model, frames: str, baseline: Path | None, noise_V: float | None,
                 out: Path | None, rate_hz: float, scaling: str = "auto", held_s: float | None = None) -> None:
    from contextlib import nullcontext

    from surrogate.data.frame_rows import sound_lines
    from surrogate.data.frame_source import opened
    from surrogate.data.reading_noise import white_noise
    from surrogate.model.sweep_model import SweepModel
    from surrogate.model.tracking.tracked_stream import track
    from surrogate.model.tracking.tracker import Tracker

    if isinstance(model, SweepModel):
        say_intervals(model, white_noise(0.0, model.readings))
        say_assumed(model)
    untouched = None if baseline is None else sound_lines(baseline, model.readings)
    tracker = Tracker(model, untouched, noise_V, rate_hz=rate_hz, scale_baseline=scaling, held_s=held_s, say=say)
    with (_until_stopped(out), opened(frames, say) as source,
          nullcontext(sys.stdout) if out is None else rows_written(out) as sink):
        counts = track(tracker, source, sink, say)
    if out is not None:
        print(f"{out}: {counted_frames(counts.answered, counts.flagged)}")


@contextmanager
def _until_stopped(out: Path | None) -> Iterator[None]:
    """Ctrl-C ends a stream: rows are written as they come, so that all are there."""
    try:
        yield
    except KeyboardInterrupt:
        say("stopped by Ctrl-C" + ("." if out is None else f"; {out} holds all rows so far."))
        raise typer.Exit(STOPPED) from None
