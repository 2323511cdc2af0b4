"""Frames that a command is given: the untouched one, the noise, and words on them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surrogate.data.baseline_frame import Comparison, Untouched
    from surrogate.data.frame_rows import Lines
    from surrogate.data.reading_noise import ReadingNoise
    from surrogate.model.model import Model
    from touchcal.arrays import Mask


def compared_with(model: Model, reference: Untouched, noise: ReadingNoise, scaling: str) -> Comparison:
    """The untouched frame next to the training's; says what differs."""
    from surrogate.data.baseline_frame import compared

    found = compared(model.baseline_V, model.ring, reference.volts, noise.rms_V, scaling)
    if found.words:
        say(found.words)
    return found


def say_assumed(model: Model) -> None:
    from surrogate.model.assumed_punch import assumed_punch

    say(f"answers assume {assumed_punch(model)}; another punch may be read wrongly with no flag.")


def say_holding(model: Model, held_s: float | None) -> None:
    from surrogate.model.holding_time import holding_caution

    if words := holding_caution(model, held_s):
        say(words)


def noise_of(reference: Untouched, given: float | None) -> ReadingNoise:
    """The noise of a signal; a caution where it is unknown, or known but for what readings share."""
    from surrogate.data.reading_noise import FEWEST, white_noise

    if given is None and reference.noise is None:
        say("the noise of the readings is unknown, so the intervals leave it out. Give --noise-V, or two or more "
            "untouched frames with --baseline.")
    elif given is not None or (reference.noise is not None and not reference.noise.root.size):
        say("the intervals assume independent noise of one size in all readings; --baseline with "
            f"{FEWEST} or more untouched frames, without --noise-V, gives what readings share.")
    white = white_noise(given or 0.0, len(reference.volts))
    return white if given is not None or reference.noise is None else reference.noise


def say_intervals(model: Model, noise: ReadingNoise) -> None:
    from surrogate.model.trained import calibrated
    from surrogate.statistics.conformal import few

    if not calibrated(model, noise):
        say("the intervals are calibrated at this noise first, which takes a while; they are kept for the next time.")
    if words := few(len(model.calibration.target)):
        say(words)


def say(words: str) -> None:
    print(f"surrogate: {words}", file=sys.stderr)


def untouched_of(model: Model, baseline: Path) -> tuple[Untouched, Mask]:
    from surrogate.data.baseline_frame import untouched
    from surrogate.data.frame_rows import sound_lines
    from surrogate.model.missing_channels import check_needed, silent, stuck

    volts = sound_lines(baseline, len(model.baseline_V))
    dead = stuck(volts) | silent(volts, model.baseline_V).any(axis=0)
    check_needed(model, dead, str(baseline))
    return untouched(volts, model.ring), dead


def frames_of(model: Model, path: Path, baseline: Path | None) -> tuple[Lines, Untouched, Mask]:
    """Frames of a file, their untouched frame, and channels that are dead in all of them."""
    from surrogate.data.baseline_frame import Untouched
    from surrogate.data.frame_rows import first_frame, read_lines
    from surrogate.model.missing_channels import check_needed, silent, stuck

    read = read_lines(path, len(model.baseline_V))
    dead = stuck(read.volts)
    check_needed(model, dead, str(path))
    if baseline is not None:
        reference, lost = untouched_of(model, baseline)
        return read, reference, dead | lost
    first = first_frame(read, str(path))
    if len(read.line) < 2:
        raise ValueError(f"{path}: one frame only, and it is taken as the untouched one. Give --baseline FILE, or "
                         "put the untouched frame first.")
    where = f"{path}, line {read.line[0]}"
    check_needed(model, silent(first[None], model.baseline_V)[0], where)
    say(f"{where} is taken as the untouched frame; give --baseline FILE where it is not.")
    return read.after_first(), Untouched(first, None), dead


def counted_frames(frames: int, flagged: int) -> str:
    return f"{frames} frame{'' if frames == 1 else 's'}, {flagged or 'none'} flagged."
