"""Command line of `surrogate`: its commands, and those that train and score."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surrogate.cli.frame_command import frame
from surrogate.cli.given_frames import ModelFolder
from surrogate.cli.learn_command import cores, learn
from surrogate.cli.limit_command import limit
from surrogate.cli.live_command import live
from surrogate.cli.predict_command import predict
from surrogate.cli.printed_scores import collapses, print_next, print_scores, print_transfer, print_verdict
from surrogate.cli.several_command import evaluate_several
from surrogate.learners.registry import METHODS, method_of
from touchcal.terminal import (
    NOT_CONVERGED,
    JsonOption,
    SeedOption,
    application,
    check_out,
    counted,
    numbers,
    print_json,
    run,
    waiting,
)

if TYPE_CHECKING:
    from surrogate.data.samples import SweepSamples

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

app = application("Learn touches from electrode voltages: the paper's networks, a forward map, ridge regression.")

VerboseOption = Annotated[bool, typer.Option("--verbose", help="Also print training rows, what intervals hold, what "
                                                                "errors come from and the range of the training.")]
TrainedOn = Annotated[Path, typer.Argument(metavar="DIR", help="Data set that `eitsim sweep` wrote.")]
OfPresses = Annotated[Path | None, typer.Option(hidden=True)]
SCORED_HELP = ("Data sets that `eitsim sweep` wrote, or for a model of a recording recorded frames with --labels; "
               "several are compared.")
EACH_LABELS_HELP = ("Labels of a recording, as of `surrogate learn`; one for each recording, in the same order. "
                    "Presses of the training are recognised where the untouched frames around them are the same, with "
                    "fewer digits too.")


JUDGED_HELP = ("Model that `surrogate learn` wrote, or a CSV of predictions from elsewhere with the columns that "
               "`surrogate predict` writes: touch, x0_mm, x0_lo90_mm, x0_hi90_mm ..., and flag where there is one.")
METHOD_HELP = "; ".join(f"{one.name}: {one.summary}" for one in METHODS.values()) + "."
OUTPUTS_HELP = "all, or names separated by commas: x0, y0, d, F, sigma_max, sigma_ave, A_c, delta_max, and z0 " \
               "of curved skins."
STEPS = ", ".join(f"{one.epochs} for {one.name}" for one in METHODS.values() if one.epochs)
WORKERS_HELP = "Processes that share the networks; by default one, and one a core from 1,000 rows on."
CALIBRATE_HELP = "Data set, as of another mesh, whose rows calibrate the intervals in place of 15 % of DIR."
EXACT_HELP = ("Take signals as exact: the error that the simulator states of them does not count. For comparing "
              "methods on simulated touches, not for a real sensor.")
PUNCHES_HELP = ("All touches to be read are by punches of the profile and the few diameters of the sweep: d and F "
                "are surer, and wrong for any other punch. Method forward.")
LEVELS_HELP = "Noise levels of the stored scores, next to no noise, in dB below the RMS of the baseline voltages."


@app.command()
def train(folder: TrainedOn, out: Annotated[Path, typer.Option(help="Folder of the model.")],
          method: Annotated[str, typer.Option(help=METHOD_HELP)] = "forward",
          outputs: Annotated[str, typer.Option(help=OUTPUTS_HELP)] = "all",
          labels: OfPresses = None, sensor: OfPresses = None, simulated: OfPresses = None,
          suggest: Annotated[int | None, typer.Option(hidden=True, min=1)] = None, seed: SeedOption = 0,
          epochs: Annotated[int | None, typer.Option(help=f"Most training steps; by default {STEPS}.")] = None,
          workers: Annotated[int | None, typer.Option(min=1, help=WORKERS_HELP)] = None,
          calibrate: Annotated[Path | None, typer.Option(help=CALIBRATE_HELP)] = None,
          exact_signals: Annotated[bool, typer.Option("--exact-signals", help=EXACT_HELP)] = False,
          known_punches: Annotated[bool, typer.Option("--known-punches", help=PUNCHES_HELP)] = False,
          noise_db: Annotated[str, typer.Option(help=LEVELS_HELP)] = "100,80,60", verbose: VerboseOption = False,
          as_json: JsonOption = False) -> None:
    """Train on a data set: 70 % of its touches train, 15 % calibrate the intervals, 15 % test. Recorded presses are
    learnt by `surrogate learn`.

    Example: surrogate train sweep --out forward --method forward --seed 1
    """
    import surrogate
    from surrogate.data.outputs import chosen
    from surrogate.data.samples import MIN_TOUCHES
    from surrogate.model import store

    if folder.is_file() or any(one is not None for one in (labels, sensor, simulated, suggest)):
        if (method, outputs, epochs, calibrate, exact_signals, known_punches) != (
                "forward", "all", None, None, False, False):
            raise ValueError("--method, --outputs, --epochs, --calibrate, --exact-signals and --known-punches are "
                             "for sweeps; a recording is learnt by all families of readers, for all of its labels. "
                             "Leave them out.")
        learn(folder, out, labels, sensor, simulated, suggest, seed=seed, workers=workers, as_json=as_json)
        return
    check_out(out, folder=True)
    store.check_own(out)
    method_of(method)
    chosen(outputs)
    levels = _levels(noise_db)
    samples = _samples(folder, MIN_TOUCHES)
    workers = workers or (cores() if len(samples) >= 1000 else 1)
    with waiting("learning the touches"):
        model = surrogate.train(samples, method, outputs, seed, epochs=epochs, workers=workers, calibrate=calibrate,
                                each=counted("networks"), exact_signals=exact_signals, known_punches=known_punches)
    model.save(out)
    with waiting("scoring the model, which calibrates its intervals"):
        own = METHODS[model.method]
        result = surrogate.evaluate(model, samples, levels, most_trained=own.most_scored, most_noisy=own.most_noisy)
    store.save_evaluation(out, result.scores, result.predictions)
    if as_json:
        print_json({"model": out, "training": model.record["training"], **result.scores})
    else:
        print_scores(result.scores, verbose=verbose, more=collapses(model))
        print_next(model, out)


@app.command()
def evaluate(model_folder: ModelFolder,
             folders: Annotated[list[Path], typer.Argument(metavar="DIR|RECORDING...", help=SCORED_HELP)],
             labels: Annotated[list[Path] | None, typer.Option(help=EACH_LABELS_HELP)] = None,
             noise_db: Annotated[str, typer.Option(help="Noise levels in dB, separated by commas.")] = "",
             noise_reference: Annotated[str, typer.Option(help="What a level lies below: the RMS of the baseline "
                                                               "voltages, or of the signal.")] = "baseline",
             verbose: VerboseOption = False, as_json: JsonOption = False) -> None:
    """Score a model on data sets, or a model of a recording on recordings; rows it was trained on are listed
    separately. "in 90 %" is how many per cent of the rows the 90 % intervals hold, "+-90 %" their median half width.
    Where `surrogate limit CARD --data DIR --out MODEL_DIR/limits.csv` was run, the least possible errors under noise
    stand next to those of DIR with --verbose.

    Example: surrogate evaluate forward sweep other-mesh --noise-db 80,60,40 --json

    Example: surrogate evaluate model frames.csv --labels kept_back.csv
    """
    import surrogate
    from surrogate.bounds.bound_files import read_limits, with_limits
    from surrogate.model.evaluate import transfer
    from surrogate.model.recorded.press_model import PressModel
    from surrogate.model.recorded.set_model import SetModel

    levels, model, limits = _levels(noise_db), surrogate.load(model_folder), read_limits(model_folder)
    if isinstance(model, SetModel):
        evaluate_several(model, folders, labels or [], as_json)
        return
    if isinstance(model, PressModel):
        if levels or noise_reference != "baseline":
            raise ValueError(f"{model_folder} was trained on a recording, which has its own noise. Leave out "
                             "--noise-db and --noise-reference.")
        if len(labels or []) != len(folders):
            raise ValueError(f"{model_folder} was trained on a recording, and is scored on labelled recordings: got "
                             f"{len(labels or [])} files of labels for {', '.join(map(str, folders))}. Give one "
                             "--labels touches.csv for each, in the same order, with touch and any of x_mm, y_mm, "
                             "d_mm, F_N, depth_mm, z_mm.")
    elif labels:
        raise ValueError(f"--labels are those of a recording, and {model_folder} is a model of a sweep, which is "
                         "scored on sweeps. Leave them out.")
    with waiting("scoring the model"):
        if isinstance(model, PressModel):
            sets = {f"{path}, {one}": surrogate.evaluate(model, path, labels=one).scores
                    for path, one in zip(folders, labels or [], strict=True)}
        else:
            sets = {str(folder): with_limits(surrogate.evaluate(model, _samples(folder), levels, noise_reference,
                                                                METHODS[model.method].most_scored).scores, limits)
                    for folder in folders}
    if not as_json:
        compared = transfer(sets) if len(sets) > 1 else {}
        for name, scores in sets.items():
            if len(sets) > 1:
                print(f"{name}:")
            print_scores(scores, verbose=verbose, over_first={
                output: row["rmse_over_first"] for output, rows in compared.items() for row in rows
                if row["set"] == name})
            if "verdict" in scores:
                print_verdict(scores, verbose=verbose)
        if verbose and compared:
            print_transfer(compared)
    elif len(sets) == 1:
        print_json({"model": model_folder, **next(iter(sets.values()))})
    else:
        print_json({"model": model_folder, "sets": sets, "transfer": transfer(sets)})


@app.command()
def audit(judged: Annotated[Path, typer.Argument(metavar="MODEL|PREDICTIONS.csv", help=JUDGED_HELP)],
          recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recorded frames.")],
          labels: Annotated[Path, typer.Option(help="Labels of the recording, as of `surrogate learn`.")],
          as_json: JsonOption = False) -> None:
    """Whether 90 % intervals hold on labelled presses of a recording: `evaluate --verbose` with a verdict, of a model
    of presses or of a table of predictions from elsewhere. Ends with status 3 where a binomial test at the number of
    presses says that they hold fewer than they state, or where every frame is flagged.

    Example: surrogate audit model frames.csv --labels kept_back.csv

    Example: surrogate audit predictions.csv frames.csv --labels kept_back.csv
    """
    import surrogate
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.labels import read_labels
    from surrogate.model.model import load_single
    from surrogate.model.recorded.press_model import PressModel
    from surrogate.model.recorded.reader_evaluation import evaluate_predictions, read_predictions

    if judged.is_file():
        frames = open_recording(recording, kind="difference")  # values are read elsewhere: names of touches serve here
        scores = evaluate_predictions(read_predictions(judged), frames, read_labels(labels), str(labels))
    else:
        model = load_single(judged)
        if not isinstance(model, PressModel):
            raise ValueError(f"{judged} is a model of a sweep, which `surrogate evaluate` scores on sweeps. Give one "
                             "of presses, or a table of predictions.")
        with waiting("scoring the model"):
            scores = surrogate.evaluate(model, recording, labels=labels).scores
    if as_json:
        print_json({"model": judged, **scores})
    else:
        if scores["scored"] and scores["verdict"]:
            print(f"scored: {scores['scored']}")
        print_verdict(scores, verbose=True)
    if scores["verdict"] is None or not scores["verdict"]["holds"]:
        raise typer.Exit(NOT_CONVERGED)


@app.command()
def export(model_folder: ModelFolder, out: Annotated[Path, typer.Option(help="TorchScript file to write.")]) -> None:
    """Write a network as TorchScript: differences to the untouched frame in V to outputs in their units.

    Example: surrogate export network --out network.pt
    """
    from surrogate.model import torchscript as script
    from surrogate.model.model import load_of_sweep

    check_out(out)
    described = script.write(load_of_sweep(model_folder), out)
    print(f"network: {out}, for torch.jit.load")
    print(f"takes {described['inputs']}; gives {described['outputs']}")


@app.command()
def report(model_folder: ModelFolder, out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write a PDF of a model: predictions against targets, scores, training record; the least possible errors next to
    its own where `surrogate limit CARD --data DIR --out MODEL_DIR/limits.csv` was run before. Of a recording's model:
    its scores on both splits, its families, and its errors over the skin.

    Example: surrogate report forward --out forward.pdf
    """
    from reports.surrogate import surrogate_report

    check_out(out)
    surrogate_report.write(model_folder, out)
    print(f"report: {out}")


def _samples(folder: Path, fewest: int = 1) -> SweepSamples:
    """The rows of a data set; how many are missing is said on standard error."""
    from eitsim.sweeps.dataset.parquet import missing_rows
    from surrogate.data.samples import read_samples

    samples = read_samples(folder, fewest)
    if words := missing_rows(folder):
        print(f"surrogate: {folder}: {words}.", file=sys.stderr)
    return samples


app.command()(learn)
app.command()(predict)
app.command()(frame)
app.command()(live)
app.command()(limit)


def _levels(text: str) -> list[float]:
    return numbers(text, "--noise-db", "80,60") if text else []


def main() -> None:
    """Entry point."""
    run(app, "surrogate", {"map": "--map"})
