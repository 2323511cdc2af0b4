"""`surrogate frame`: one frame in depth, by its posterior, by the simulator itself, or as two touches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surrogate.cli.given_frames import (
    BASELINE_HELP,
    ModelFolder,
    NoiseV,
    Scaling,
    check_noise,
    check_written,
    compared_frames,
    say,
    say_assumed,
    write_rows,
)
from touchcal.terminal import JsonOption, SeedOption, counted, waiting

if TYPE_CHECKING:
    import pandas as pd

    from surrogate.cli.given_frames import ComparedFrames
    from surrogate.model.sweep_model import SweepModel
    from surrogate.single_frame.simulator_likelihood import Simulator
    from touchcal.arrays import Array

DIRECT_HELP = "Invert the simulator itself, from the learned answer on; needs --card."
POSTERIOR_HELP = ("Sample the posterior of each frame with emcee, on the learned map, or with --card by the simulator; "
                  "so without another way.")
TOUCHES_HELP = "Most touches that a frame may have, 2 to 4: they are counted and each is read."
CARD_HELP = "Card of foam and skin, for --direct, and for --posterior by the simulator."


def frame(model_folder: ModelFolder,
          frames: Annotated[str, typer.Argument(metavar="FRAMES", help="CSV, one frame of voltages a row.")],
          baseline: Annotated[Path | None, typer.Option(help=BASELINE_HELP)] = None, noise_v: NoiseV = None,
          scale_baseline: Scaling = "auto",
          posterior: Annotated[bool, typer.Option("--posterior", help=POSTERIOR_HELP)] = False,
          direct: Annotated[bool, typer.Option("--direct", help=DIRECT_HELP)] = False,
          touches: Annotated[int, typer.Option(min=1, max=4, help=TOUCHES_HELP)] = 1,
          card: Annotated[Path | None, typer.Option(help=CARD_HELP)] = None,
          data: Annotated[Path | None, typer.Option(help="Data set whose design describes the sensor of "
                                                         "--card.")] = None,
          scene: Annotated[Path | None, typer.Option(help="Scene that describes the sensor of --card.")] = None,
          seed: SeedOption = 0,
          out: Annotated[Path | None, typer.Option(help="CSV to write; else standard output.")] = None,
          as_json: JsonOption = False) -> None:
    """Look at frames one by one in depth; frames with dead channels are not read. Method forward.

    Example: surrogate frame forward frames.csv --posterior --seed 1 --out posteriors.csv
    """
    from surrogate.data.frame_source import check_no_port, comes_live
    from surrogate.model.assumed_punch import assumed_punch, of_trained_profile
    from surrogate.model.model import load_of_sweep

    check_no_port(frames)
    if comes_live(frames):
        raise ValueError("frames of - or a serial port are answered as they come by `surrogate predict`; give a file.")
    check_written(out, [frames, baseline, card, scene])
    check_noise(noise_v)
    if direct + posterior + (touches > 1) > 1:
        raise ValueError("give one of --direct, --posterior and --touches: each reads a frame in its own way.")
    if direct and card is None:
        raise ValueError("--direct inverts the simulator, which needs the material; give --card CARD, and --data DIR "
                         "or --scene FILE for the sensor.")
    if card is not None and touches > 1:
        raise ValueError("--card describes the simulator of --direct or --posterior. Leave it out.")
    if card is None and (data or scene) is not None:
        raise ValueError("--data and --scene describe the sensor of the simulator, which needs --card CARD too.")
    model = of_trained_profile(load_of_sweep(model_folder))
    read = compared_frames(model, Path(frames), baseline, noise_v, scale_baseline)
    say_assumed(model)
    if touches > 1:
        table = _several(model, read, touches)
    else:
        simulator = None if card is None else _simulator(model, card, data, scene, read.untouched_V)
        table = _in_depth(model, simulator, read, None if direct else seed)
    write_rows(table, model_folder, out, as_json, {"assumes": assumed_punch(model)})


def _several(model: SweepModel, frames: ComparedFrames, most: int) -> pd.DataFrame:
    import pandas as pd

    from surrogate.model.missing_channels import silent
    from surrogate.single_frame.rows import check_whole, several_row, whole

    check_whole(frames.dead | silent(frames.untouched_V[None], model.baseline_V)[0])
    lines, noise = whole(frames.lines, model), frames.noise.rms_V
    each = zip(lines.line.tolist(), lines.volts - frames.untouched_V, lines.problem, strict=True)
    rows = [{"line": line, "flag": problem} if problem else several_row(model, line, signal, noise, most)
            for line, signal, problem in counted("frames")(each)]
    names = max((list(row) for row in rows), key=len, default=["line", "flag"])
    return pd.DataFrame(rows, columns=names)


def _simulator(model: SweepModel, card: Path, data: Path | None, scene: Path | None, untouched_V: Array) -> Simulator:
    from surrogate.single_frame.rows import check_baseline
    from surrogate.single_frame.simulator_likelihood import check_sensor, simulator_of, untouched_of

    simulator = simulator_of(card, data=data, scene=scene)
    check_sensor(simulator, model.ring)
    check_baseline(untouched_of(simulator), untouched_V)
    if not simulator.spread.parameters:
        say(f"{card} has no posterior, so the material is taken as exact.")
    elif model.ring.sheet is not None:
        say("what the card's posterior leaves open does not count: sensitivities by the material are not built for "
            "skins with an outline.")
    return simulator


def _in_depth(model: SweepModel, simulator: Simulator | None, frames: ComparedFrames, seed: int | None) -> pd.DataFrame:
    """A row a frame, by the posterior where there is a seed; each shows on a terminal as it is done."""
    import pandas as pd

    from surrogate.model.predict import prepare
    from surrogate.single_frame.rows import direct_row, learner_of, ones, posterior_row

    learner_of(model)
    if seed is not None:
        exact = model.ring.sheet is not None
        whose = ("the learned map's, its error counted, the material the model's" if simulator is None else
                 "the simulator's, the material exact" if exact else
                 "the simulator's, with what the card's posterior leaves open")
        say("prior: places uniform where the punch fits, d and F uniform over the training touches' ranges, whatever "
            f"punches these share; the likelihood is {whose}.")
    rows, noise = [], frames.noise.rms_V
    with waiting("preparing the model"):
        ready = prepare(model, frames.untouched_V, noise, frames.dead, calibrate=seed is None)
    for one in counted("frames")(ones(ready, frames.lines)):
        if seed is not None:
            rows.append(posterior_row(model, simulator, one, noise, seed))
        elif simulator is not None:
            rows.append(direct_row(model, simulator, one, noise))
    names = dict.fromkeys(name for row in rows for name in row if name != "flag")
    return pd.DataFrame(rows, columns=[*names, "flag"])
