"""Command line of `surrogate`: train, evaluate, predict, report."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from matcal.terminal import JsonOption, application, check_apart, check_out, counter, numbers, print_json, run

if TYPE_CHECKING:
    from surrogate.model import Model

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

app = application("Learn touches from electrode voltages: the paper's networks, a forward map, ridge regression.")

DataFolder = Annotated[Path, typer.Argument(metavar="DIR", help="Data set that `eitsim sweep` wrote.")]
ModelFolder = Annotated[Path, typer.Argument(metavar="MODEL_DIR", help="Model that `surrogate train` wrote.")]


@app.command()
def train(folder: DataFolder, out: Annotated[Path, typer.Option(help="Folder of the model.")],
          method: Annotated[str, typer.Option(help="trainbr (the paper's networks), forward (learned forward map, "
                                                   "inverted) or ridge.")] = "forward",
          outputs: Annotated[str, typer.Option(help="all, or names separated by commas: x0, y0, d, F, sigma_max, "
                                                    "sigma_ave, A_c, delta_max.")] = "all",
          seed: Annotated[int, typer.Option(help="Seed of the split and of the networks.")] = 0,
          epochs: Annotated[int | None, typer.Option(help="Most steps of trainbr; 1000 where left out.")] = None,
          noise_db: Annotated[str, typer.Option(help="Noise levels that the stored scores hold beside no noise, in dB "
                                                     "below the RMS of the baseline voltages.")] = "100,80,60",
          as_json: JsonOption = False) -> None:
    """Train on a data set: 70 % of its rows train, 15 % calibrate the intervals, 15 % test.

    Example: surrogate train sweep --out forward --method forward --seed 1
    """
    from surrogate import store
    from surrogate.evaluate import evaluate as scored
    from surrogate.model import check_method
    from surrogate.outputs import chosen
    from surrogate.samples import read_samples
    from surrogate.train import train as fit

    check_out(out, folder=True)
    check_method(method)
    names, levels = chosen(outputs), _levels(noise_db)
    samples = read_samples(folder)
    model = fit(samples, method, names, seed, epochs=epochs, each=_shown(names))
    store.save(model, out)
    result = scored(model, samples, levels)
    store.save_evaluation(out, result.scores, result.predictions)
    if as_json:
        print_json({"model": out, "training": model.record["training"], **result.scores})
    else:
        _print_scores(result.scores)
        _print_collapses(model)
        print(f"model: {out}")


@app.command()
def evaluate(model_folder: ModelFolder, folder: DataFolder,
             noise_db: Annotated[str, typer.Option(help="Noise levels in dB, separated by commas.")] = "",
             noise_reference: Annotated[str, typer.Option(help="What a level lies below: the RMS of the baseline "
                                                               "voltages, or of the signal.")] = "baseline",
             as_json: JsonOption = False) -> None:
    """Score a model on a data set; rows it was trained on are told apart.

    Example: surrogate evaluate forward sweep --noise-db 80,60,40 --json
    """
    from surrogate import store
    from surrogate.evaluate import evaluate as scored
    from surrogate.samples import read_samples

    levels = _levels(noise_db)
    scores = scored(store.load(model_folder), read_samples(folder), levels, noise_reference).scores
    if as_json:
        print_json({"model": model_folder, **scores})
    else:
        _print_scores(scores)


@app.command()
def predict(model_folder: ModelFolder,
            frames: Annotated[Path, typer.Argument(metavar="FRAMES", help="CSV, one frame of voltages a row.")],
            baseline: Annotated[Path | None, typer.Option(help="CSV of untouched frames; else the first row of FRAMES. "
                                                               "Two or more of them also give the noise.")] = None,
            noise_v: Annotated[float | None, typer.Option("--noise-V", help="Standard deviation of one reading, V, "
                                                                            "where known.")] = None,
            out: Annotated[Path | None, typer.Option(help="CSV to write; else standard output.")] = None) -> None:
    """Read touches from recorded frames.

    Example: surrogate predict forward frames.csv --baseline untouched.csv --out predictions.csv
    """
    from surrogate import store
    from surrogate.predict import predict_frames

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [path for path in (frames, baseline) if path is not None])
    model = store.load(model_folder)
    touched, reference = _frames(model, frames, baseline)
    if noise_v is not None and not noise_v >= 0:
        raise ValueError(f"--noise-V must be 0 or more, got {noise_v}.")
    noise = noise_v if noise_v is not None else reference.noise_V
    if noise is None:
        print("surrogate: the noise of the readings is unknown, so the intervals leave it out. Give --noise-V, or two "
              "or more untouched frames with --baseline.", file=sys.stderr)
    table = predict_frames(model, touched, reference, noise or 0.0)
    text = table.to_csv(index=False, float_format="%.6g")
    if out is None:
        print(text, end="")
    else:
        out.write_text(text, encoding="utf-8")
        print(f"{out}: {len(table)} frames, {sum(bool(flag) for flag in table['flag'])} of them flagged.")


@app.command()
def report(model_folder: ModelFolder, out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write a PDF of a model: predictions against targets, scores, training record.

    Example: surrogate report forward --out forward.pdf
    """
    from reports.surrogates import write

    check_out(out)
    write(model_folder, out)
    print(f"report: {out}")


def _levels(text: str) -> list[float]:
    return numbers(text, "--noise-db", "80,60") if text else []


def _frames(model: Model, frames: Path, baseline: Path | None) -> tuple[Any, Any]:
    from eitsim.frames import Frames, read_frames
    from surrogate.dead_channels import refuse_dead
    from surrogate.predict import untouched

    def sound(path: Path) -> Frames:
        read = read_frames(path, len(model.baseline_V))
        refuse_dead(path, read, model.baseline_V)
        return read

    read = sound(frames)
    if baseline is not None:
        return read, untouched(sound(baseline))
    if len(read.volts) < 2:
        raise ValueError(f"{frames}: one frame only, and it is taken as the untouched one. Give --baseline FILE, or "
                         "put the untouched frame first.")
    return Frames(read.volts[1:], read.line[1:]), untouched(Frames(read.volts[:1], read.line[:1]))


def _shown(names: tuple[str, ...]) -> Any:
    def each(items: Iterable[int]) -> Iterator[int]:
        with counter(len(names), "networks") as advance:
            for done, item in enumerate(items, start=1):
                yield item
                advance(done)

    return each


def _print_scores(result: Mapping[str, Any]) -> None:
    """Tables of the scores: training and unseen rows without noise, unseen rows under noise; --json has them all."""
    _print_table(f"{result['method']}, no noise", result["outputs"], ("train", "test", "new", "all"))
    for level in result["noise"]:
        title = (f"{result['method']}, noise {level['db_below_baseline']:.1f} dB below the baseline,\n"
                 f"{level['db_below_signal']:.1f} dB below the signal")
        _print_table(title, level["outputs"], ("test", "new", "all"))
    print(f"fit {result['fit_s']:.1f} CPU s, predict {result['predict_ms']:.2f} CPU ms a frame; baseline RMS "
          f"{result['baseline_rms_V']:.4g} V, signal RMS {result['signal_rms_V']:.4g} V")
    if result["interval_caution"]:
        print(f"caution: {result['interval_caution']}")


def _print_table(title: str, scored: Mapping[str, Any], shown: tuple[str, ...]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("output", "rows", "RMSE", "MAE", "R2", "in 90 %", "n", title=title)
    for name, parts in scored.items():
        for part in (p for p in shown if p in parts):
            s = parts[part]
            r2 = "-" if s["r2"] is None else f"{s['r2']:.4f}"
            table.add_row(name, part, f"{s['rmse']:.4g} {s['unit']}", f"{s['mae']:.4g}", r2, f"{s['coverage_90']:.0%}",
                          str(s["n"]))
    Console().print(table)


def _print_collapses(model: Model) -> None:
    for name, record in model.record["training"].items():
        if isinstance(record, dict) and record.get("collapsed"):
            print(f"{name}: the evidence collapsed in every start; this network says little more than the mean.")


def main() -> None:
    """Entry point."""
    run(app, "surrogate")
