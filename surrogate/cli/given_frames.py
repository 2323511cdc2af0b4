"""Frames that a command is given: the untouched one, the noise, and words on them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from touchcal.terminal import check_apart, check_out, print_json
from touchcal.whole_file import written

if TYPE_CHECKING:
    import pandas as pd

    from eitsim.sensors.recording import Recording
    from surrogate.data.baseline_frame import Untouched
    from surrogate.data.frame_rows import Lines
    from surrogate.data.reading_noise import ReadingNoise
    from surrogate.model.recorded.press_model import PressModel
    from surrogate.model.recorded.set_model import SetModel
    from surrogate.model.sweep_model import SweepModel
    from touchcal.arrays import Array, Mask


ModelFolder = Annotated[Path, typer.Argument(metavar="MODEL_DIR", help="Model that `surrogate train` or `learn` "
                                                                       "wrote.")]
BASELINE_HELP = ("CSV of untouched frames; else the first row of FRAMES, or the first 20 frames of a stream (method "
                 "forward). Two or more of them also give the noise.")
SCALE_HELP = ("Multiply all readings by the training's untouched ones over those measured: yes, no, or auto, where "
              "that explains a difference larger than noise.")
NoiseV = Annotated[float | None, typer.Option("--noise-V", help="Standard deviation of one reading, V, where known.")]
Scaling = Annotated[str, typer.Option(help=SCALE_HELP)]
MOST_NOISE_V = 1000.0  # no instrument reads more, and equations of more noise are singular


@dataclass(frozen=True, eq=False)
class ComparedFrames:
    """Frames of a file, scaled where the untouched one asks for it."""

    lines: Lines
    untouched_V: Array  # (readings,)
    dead: Mask  # (readings,) channels that are dead in all of them
    noise: ReadingNoise  # of a signal


def check_noise(noise_V: float | None) -> None:
    """ValueError where the stated noise is none of an instrument."""
    if noise_V is not None and not 0 <= noise_V <= MOST_NOISE_V:
        raise ValueError(f"--noise-V must be 0 to {MOST_NOISE_V:g} V, got {noise_V:g}. Give the standard deviation of "
                         "one reading in volts.")


def check_written(out: Path | None, given: Sequence[Path | str | None]) -> None:
    """ValueError where the file to write cannot be, or is one of those given."""
    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [Path(path) for path in given if path is not None])


def compared_frames(model: SweepModel, path: Path, baseline: Path | None, noise_V: float | None,
                    scaling: str) -> ComparedFrames:
    """The frames of a file next to the training's; says what differs, and what is known of the noise."""
    from surrogate.data.baseline_frame import compared

    read, reference, dead = frames_of(model, path, baseline)
    noise = noise_of(reference, noise_V)
    found = compared(model.baseline_V, model.ring, reference.volts, noise.rms_V, scaling)
    if found.words:
        say(found.words)
    return ComparedFrames(replace(read, volts=read.volts * found.gain), reference.volts * found.gain, dead,
                          noise.scaled(found.gain))


def recorded(model: PressModel | SetModel, path: Path) -> Recording:
    """A recording of the readings that a model knows."""
    from eitsim.sensors.formats.open_file import open_recording

    return open_recording(path, kind=model.kind, readings=model.readings)


def write_rows(table: pd.DataFrame, model: Path, out: Path | None, as_json: bool,
               stated: dict[str, str] | None = None, *, a_press: bool = False) -> None:
    """Write what was read as CSV, and print it, JSON of it, or how many frames there are; presses, if a row is one."""
    if out is not None:
        with written(out) as file:
            file.write(table.to_csv(index=False, float_format="%.6g").encode())
    if as_json:
        print_json({"model": model, **(stated or {}), "frames": [_plain(row) for row in table.to_dict("records")]})
    elif out is None:
        print(table.to_csv(index=False, float_format="%.6g"), end="")
    else:
        print(f"{out}: {counted_frames(len(table), sum(bool(flag) for flag in table['flag']), a_press=a_press)}")


def _plain(row: dict[Any, Any]) -> dict[str, Any]:
    """A row without NaN, which JSON has not."""
    return {str(key): None if isinstance(value, float) and value != value else value for key, value in row.items()}


def say_assumed(model: SweepModel) -> None:
    from surrogate.model.assumed_punch import assumed_punch

    say(f"answers assume {assumed_punch(model)}; another punch may be read wrongly with no flag.")


def say_holding(model: SweepModel, held_s: float | None) -> None:
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


def say_intervals(model: SweepModel, noise: ReadingNoise) -> None:
    from surrogate.model.trained import calibrated
    from surrogate.statistics.conformal import few

    if not calibrated(model, noise):
        say("the intervals are calibrated at this noise first, which takes a while; they are kept for the next time.")
    if words := few(len(model.calibration.target)):
        say(words)


def say(words: str) -> None:
    print(f"surrogate: {words}", file=sys.stderr)


def untouched_of(model: SweepModel, baseline: Path) -> tuple[Untouched, Mask]:
    from surrogate.data.baseline_frame import untouched
    from surrogate.data.frame_rows import sound_lines
    from surrogate.model.missing_channels import check_enough, silent, stuck

    volts = sound_lines(baseline, len(model.baseline_V))
    dead = stuck(volts) | silent(volts, model.baseline_V).any(axis=0)
    check_enough(dead, str(baseline))
    return untouched(volts, model.ring), dead


def frames_of(model: SweepModel, path: Path, baseline: Path | None) -> tuple[Lines, Untouched, Mask]:
    """Frames of a file, their untouched frame, and channels that are dead in all of them."""
    from surrogate.data.baseline_frame import Untouched
    from surrogate.data.frame_rows import first_frame, read_lines
    from surrogate.model import sticking
    from surrogate.model.missing_channels import check_enough, silent, stuck

    read = read_lines(path, len(model.baseline_V))
    dead = stuck(read.volts)
    read = replace(read, volts=sticking.off(read.volts))
    check_enough(dead, str(path))
    if baseline is not None:
        reference, lost = untouched_of(model, baseline)
        return read, reference, dead | lost
    first = first_frame(read, str(path))
    if len(read.line) < 2:
        raise ValueError(f"{path}: one frame only, and it is taken as the untouched one. Give --baseline FILE, or "
                         "put the untouched frame first.")
    where = f"{path}, line {read.line[0]}"
    check_enough(silent(first[None], model.baseline_V)[0], where)
    say(f"{where} is taken as the untouched frame; give --baseline FILE where it is not.")
    return read.after_first(), Untouched(first, None), dead


def counted_frames(rows: int, flagged: int, *, a_press: bool = False) -> str:
    """How many frames, or presses, were read, and how many of them are flagged."""
    one, many = ("press", "presses") if a_press else ("frame", "frames")
    return f"{rows} {one if rows == 1 else many}, {flagged or 'none'} flagged."
