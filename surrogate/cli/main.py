"""Command line of `surrogate`: its commands, and those that train and score."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from surrogate.cli.frame_command import frame
from surrogate.cli.given_frames import ModelFolder
from surrogate.cli.learn_command import cores, learn
from surrogate.cli.limit_command import limit
from surrogate.cli.live_command import live
from surrogate.cli.predict_command import predict
from surrogate.cli.several_command import evaluate_several
from surrogate.learners.registry import METHODS, method_of
from touchcal.terminal import JsonOption, SeedOption, application, check_out, counted, numbers, print_json, run, waiting

if TYPE_CHECKING:
    from surrogate.data.samples import SweepSamples
    from surrogate.model.sweep_model import SweepModel

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

app = application("Learn touches from electrode voltages: the paper's networks, a forward map, ridge regression.")

TrainedOn = Annotated[Path, typer.Argument(metavar="DIR", help="Data set that `eitsim sweep` wrote.")]
OfPresses = Annotated[Path | None, typer.Option(hidden=True)]
SCORED_HELP = ("Data sets that `eitsim sweep` wrote, or for a model of a recording recorded frames with --labels; "
               "several are compared.")
EACH_LABELS_HELP = ("Labels of a recording, as of `surrogate train`; one for each recording, in the same order. "
                    "Presses of the training are recognised where the untouched frames around them are the same.")


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
          noise_db: Annotated[str, typer.Option(help=LEVELS_HELP)] = "100,80,60", as_json: JsonOption = False) -> None:
    """Train on a data set: 70 % of its touches train, 15 % calibrate the intervals, 15 % test. Recorded presses are
    learnt by `surrogate learn`.

    Example: surrogate train sweep --out forward --method forward --seed 1
    """
    import surrogate
    from surrogate.data.outputs import chosen
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
    samples = _samples(folder)
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
        _print_scores(result.scores)
        _print_collapses(model)
        print(f"model: {out}")


@app.command()
def evaluate(model_folder: ModelFolder,
             folders: Annotated[list[Path], typer.Argument(metavar="DIR|RECORDING...", help=SCORED_HELP)],
             labels: Annotated[list[Path] | None, typer.Option(help=EACH_LABELS_HELP)] = None,
             noise_db: Annotated[str, typer.Option(help="Noise levels in dB, separated by commas.")] = "",
             noise_reference: Annotated[str, typer.Option(help="What a level lies below: the RMS of the baseline "
                                                               "voltages, or of the signal.")] = "baseline",
             as_json: JsonOption = False) -> None:
    """Score a model on data sets, or a model of a recording on recordings; rows it was trained on are listed
    separately. "in 50/90/95 %" is how many per cent of the rows the intervals hold, "+-90 %" the median half width of
    the 90 % interval. Where `surrogate limit CARD --data DIR --out MODEL_DIR/limits.csv` was run, the least possible
    errors under noise stand next to those of DIR.

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
        for name, scores in sets.items():
            if len(sets) > 1:
                print(f"{name}:")
            _print_scores(scores)
        if len(sets) > 1:
            _print_transfer(transfer(sets))
    elif len(sets) == 1:
        print_json({"model": model_folder, **next(iter(sets.values()))})
    else:
        print_json({"model": model_folder, "sets": sets, "transfer": transfer(sets)})


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


def _samples(folder: Path) -> SweepSamples:
    """The rows of a data set; how many are missing is said on standard error."""
    from eitsim.sweeps.dataset.parquet import missing_rows
    from surrogate.data.samples import read_samples

    samples = read_samples(folder)
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


def _print_scores(result: Mapping[str, Any]) -> None:
    """Tables of the scores: training and unseen rows without noise, unseen rows under noise; --json has them
    all, and mean absolute errors."""
    _print_table(f"{result['method']}, no noise added", result["outputs"], ("train", "test", "new", "all"), {})
    for level in result["noise"]:
        title = (f"{result['method']}, noise {level['db_below_baseline']:.1f} dB below the baseline,\n"
                 f"{level['db_below_signal']:.1f} dB below the signal")
        _print_table(title, level["outputs"], ("test", "new", "all"), level.get("limits", {}))
    print(f"fit {result['fit_s']:.1f} CPU s, predict {result['predict_ms']:.2f} CPU ms a frame")
    if result["scored"]:
        print(f"scored: {result['scored']}")
    _print_wanting(result)
    if "intervals" in result:
        _print_of_sweep(result)


def _print_wanting(result: Mapping[str, Any]) -> None:
    """Cautions on outputs that are read no better than by their mean, and on intervals that hold too little."""
    from surrogate.statistics.coverage_check import CoverageCheck, in_words

    for name, parts in result["outputs"].items():
        worst = min((s["r2"] for part, s in parts.items() if part != "train" and s["r2"] is not None), default=1.0)
        if worst <= 0:
            print(f"caution: {name} is read no better than by its mean, R2 {worst:.3g}: do not use this output.")
    if "intervals" in result:
        for words in _off_nominal(result):
            print(f"caution: {words}")
    else:
        for one in result.get("coverage_below", ()):
            check = CoverageCheck(**{field: one[field] for field in CoverageCheck.__dataclass_fields__})
            print(f"caution: {in_words(check, one['output'])}")


def _off_nominal(result: Mapping[str, Any]) -> Iterator[str]:
    """Of unseen rows whose intervals hold a smaller part than they state, by output and noise, in words."""
    from surrogate.statistics.coverage_check import coverage_check, in_words

    tables = [("without added noise", result["outputs"])]
    tables += [(f"at {level['db_below_baseline']:.1f} dB", level["outputs"]) for level in result["noise"]]
    scored = [(f"{name}, {part} rows, {where}", one) for where, outputs in tables for name, parts in outputs.items()
              for part, one in parts.items() if part != "train"]
    for name, one in scored:
        if (check := coverage_check(one["coverage_90"], one["n"], checks=len(scored))).too_low:
            yield in_words(check, name)


def _print_of_sweep(result: Mapping[str, Any]) -> None:
    """What is known of a data set and its model, and not of a recording."""
    print(f"baseline RMS {result['baseline_rms_V']:.4g} V, signal RMS {result['signal_rms_V']:.4g} V")
    if result["force_sd"]:
        parts = ", ".join(f"{part} {value:.3g}" for part, value in result["force_sd"].items())
        print(f"standard deviation of the force, N, RMS before calibration, squares add up: {parts}")
    if result["material"]:
        print(f"material: {result['material']}")
    print(f"intervals: {result['intervals']}")
    if result["amplitude"]:
        _print_amplitude(result["amplitude"])
    units = {name: next(iter(parts.values()))["unit"] for name, parts in result["outputs"].items()}
    spans = ", ".join(f"{name} {low:.4g} to {high:.4g} {units[name]}"
                      for name, (low, high) in result["trained_range"].items())
    print(f"trained range, within which intervals hold: {spans}")
    for caution in filter(None, (result["few_interval_rows"], result["interval_caution"])):
        print(f"caution: {caution}")


def _print_table(title: str, scored: Mapping[str, Any], shown: tuple[str, ...],
                 limits: Mapping[str, Mapping[str, float]]) -> None:
    """limits: material -> output -> least possible error, as `bound_files.at_level`."""
    from rich.console import Console
    from rich.table import Table

    from surrogate.bounds.bound_files import MATERIALS

    table = Table("output", "rows", "RMSE", "R2", "in 50/90/95 %", "+-90 %", "n",
                  *(MATERIALS[name] for name in limits), title=title)
    for name, parts in scored.items():
        for part in (p for p in shown if p in parts):
            s = parts[part]
            r2 = "constant" if s["r2"] is None else f"{s['r2']:.4f}"
            least = [f"{of[name]:.4g}" if name in of else "-" for of in limits.values()]
            table.add_row(name, part, f"{s['rmse']:.4g} {s['unit']}", r2, _held(s),
                          f"{s['half_width_90']:.4g}", str(s["n"]), *least)
    Console().print(table)


def _print_amplitude(amplitude: Mapping[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("d, mm", "RMS at its top, mV", "at F, N", "RMS at most F, mV", "F of two answers, N",
                  title=f"signal over force, {amplitude['radius_mm']:.3g} mm from {amplitude['centre']}")
    for one in amplitude["diameters"]:
        ends, force = one["two_answers_N"], amplitude["force_N"]
        peak = force[-1] if one["peak_N"] is None else one["peak_N"]
        table.add_row(f"{one['d_mm']:.4g}", f"{1e3 * one['rms_V'][force.index(peak)]:.3g}",
                      "highest" if one["peak_N"] is None else f"{peak:.2f}", f"{1e3 * one['rms_V'][-1]:.3g}",
                      "-" if ends is None else f"{ends[0]:.2f} to {ends[1]:.2f}")
    Console().print(table)


def _print_transfer(table: Mapping[str, list[dict[str, Any]]]) -> None:
    from rich.console import Console
    from rich.table import Table

    shown = Table("output", "set", "rows", "RMSE", "over first", "in 50/90/95 %", "+-90 %", "n",
                  title="transfer, no noise added, unseen rows")
    for name, rows in table.items():
        for s in rows:
            over = "-" if s["rmse_over_first"] is None else f"{s['rmse_over_first']:.3g}"
            shown.add_row(name, s["set"], s["part"], f"{s['rmse']:.4g} {s['unit']}", over, _held(s),
                          f"{s['half_width_90']:.4g}", str(s["n"]))
    Console().print(shown)


def _held(score: Mapping[str, Any]) -> str:
    held = [score[f"coverage_{level}"] for level in (50, 90, 95)]
    return "/".join("-" if one is None else f"{100 * one:.0f}" for one in held)


def _print_collapses(model: SweepModel) -> None:
    for name, record in model.record["training"].items():
        if isinstance(record, dict) and record.get("collapsed"):
            print(f"{name}: the evidence collapsed in every start; this network says little more than the mean.")


def main() -> None:
    """Entry point."""
    run(app, "surrogate", {"map": "--map"})
