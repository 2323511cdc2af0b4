"""Commands of `eitsim` on data sets: sweep, measure, indices; and on results: report."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eitsim.cli.fitted_card import check_card_of_design
from matcal.card import MaterialCard, read_card
from touchcal.number_words import counted
from touchcal.terminal import JsonOption, check_apart, check_out, numbers, print_json

if TYPE_CHECKING:
    from eitsim.sweeps.design.design import Design
    from eitsim.sweeps.run.sweep import Progress


def sweep(design: Annotated[Path, typer.Argument(metavar="DESIGN", help="Design file (TOML), or a table of scenes "
                                                                              "(CSV, one row a scene).")],
          card: Annotated[Path, typer.Option(help="Material card.")],
          out: Annotated[Path, typer.Option(help="Folder of the data set; an unfinished one is continued.")],
          scenes: Annotated[int | None, typer.Option(help="Number of scenes, in place of the design's.")] = None,
          scene: Annotated[Path | None, typer.Option("--scene", help="With a table: scene file of what its columns "
                                                     "leave out; seed and [material] too.")] = None,
          reuse: Annotated[bool | None, typer.Option("--reuse/--no-reuse", help="Take touches from a table of load "
                                                     "paths; by default where that repays its cost.")] = None,
          exact: Annotated[bool, typer.Option("--exact", help="Solve every row as `run --exact` does.")] = False,
          other_code: Annotated[bool, typer.Option("--other-code", help="Continue a folder that other code or "
                                                   "libraries made; design.json says which rows are whose.")] = False,
          workers: Annotated[int | None, typer.Option(help="Processes, one thread each; by default one for every "
                                                      "processor.")] = None,
          scheduler: Annotated[str | None, typer.Option(help="Address of a dask scheduler whose workers solve the "
                                                        "scenes, in place of --workers.")] = None,
          log_every: Annotated[float, typer.Option("--log-every", metavar="SECONDS", help="Seconds between lines of "
                                                   "progress where standard error is no terminal; 0 for none.")] = 0.0,
          report: Annotated[Path | None, typer.Option(help="Write a PDF report of the data set here, at the "
                                                           "end.")] = None,
          as_json: JsonOption = False) -> None:
    """Solve many scenes into Parquet parts; started again on the same folder, it continues. At the end it prints
    outcomes, errors of the signal, and the CPU seconds of each stage.

    A design begins with scenes = 200, seed = 1 and sampler = "random" (its count may grow), "lhs", "sobol" (both fix
    it) or "nested" (for `eitsim indices`); then come the tables of a scene file. [accuracy] signal = 0.01 is the
    requested relative error of the signal. [material] draws = 200 takes cards of the posterior, [measurement] is
    what `eitsim measure` adds, [fields] names = ["strain"] stores images of the skin next to the rows.

    Any scalar of a scene may be a range [lo, hi], {choice = [...]} or {dist = "normal", mean = , sd = } (or
    lognormal, uniform, loguniform, integer; lo and hi cut off), by chance, or {list = [...]}, whose combinations are
    gone through. [punch] place = {grid = "polar", spacing_mm = 10} (or square; sunflower with count) or {list =
    [[x, y], ...]} are lists of places; without place, x_mm and y_mm touches are uniform over the disc, or over
    another outline so far from edges that these do not count; place = {gap_mm = 1} lets punches come so near to them.
    touches = [1, 2] draws their number. A table has columns x_mm, y_mm, d_mm, F_N, any key of [punch],
    skin.thickness_um and so on, and x_2_mm, punch_2_profile of further touches.

    Example: eitsim sweep examples/design.toml --card card.json --scenes 200 --workers 2 --out sweep

    Example: eitsim sweep scenes.csv --scene scene.toml --card card.json --out sweep
    """
    from eitsim.cli.progress import in_words
    from eitsim.sweeps.dataset.parquet import OTHER_PROFILES
    from eitsim.sweeps.design.design import kept_from_edges
    from eitsim.sweeps.run.account import account_of, document, lines
    from eitsim.sweeps.run.other_profiles import other_profiles
    from eitsim.sweeps.run.scene_table import as_design
    from eitsim.sweeps.run.sweep import sweep as solve_design

    check_out(out, folder=True)
    if report is not None:
        check_out(report, "--report")
        check_apart({"--report": report}, [path for path in (design, card, scene) if path is not None])
        check_pdf(report, "--report")
    if workers is not None and scheduler is not None:
        raise ValueError("--workers and --scheduler exclude each other: a cluster has workers of its own. Leave one "
                         "out.")
    count = workers if workers is not None else os.cpu_count() or 1
    rows, begun = as_design(design, scenes, scene), time.perf_counter()
    material = read_card(card)
    if (file := scene if design.suffix == ".csv" else design) is not None:
        check_card_of_design(card, file)
    with _followed(rows, material, log_every, out) as progress:
        account = solve_design(rows, material, out, workers=count, scheduler=scheduler, reuse=reuse, exact=exact,
                               other_code=other_code, progress=progress).account
    assert account is not None
    spent, found = time.perf_counter() - begun, account_of(out)
    if as_json:
        print_json({"out": out, "wall_s": spent, "solved": account.solved, "kept": account.kept,
                    "method": account.method, "reasons": dict(account.reasons)} | document(found))
    else:
        by = counted(count, "worker") if scheduler is None else scheduler
        print(f"{out}: {counted(account.solved, 'scene')} finished in {spent:.1f} s on {by}, {account.kept} were "
              f"there; outcomes: {in_words(account.outcomes)}.")
        clean = (f"rows are clean: `eitsim measure {out} --out {out}-measured` adds [measurement] of the design"
                 if rows.measurement else None)
        others = (f"{same.scenes} of these touches by other profiles are in {out / OTHER_PROFILES}: `surrogate train` "
                  "learns from them what a profile changes of the force"
                  if (same := other_profiles(rows)) is not None else None)
        for line in filter(None, (clean, account.method, kept_from_edges(rows), others)):
            print(line)
        for name, message in sorted(account.reasons.items()):
            print(f"first \"{name}\": {message}")
        print("\n".join(lines(found)))
    if report is not None:
        written = report_written(out, report)
        if not as_json:
            print(written)


@contextmanager
def _followed(rows: Design, card: MaterialCard, log_every: float, out: Path) -> Iterator[Callable[[Progress], None]]:
    """A function that shows how far a sweep is, and once it has begun and rows are to be solved what the design will
    not give; a sweep that is asked to stop ends the command."""
    from eitsim.cli.progress import shown
    from eitsim.sweeps.run.omissions import cautions
    from touchcal.signals import Stopped, stoppable

    last: list[Progress] = []
    try:
        with stoppable(), shown(rows.scenes, log_every) as show:
            def follow(step: Progress) -> None:
                if not last and step.done < step.scenes:
                    for sentence in cautions(rows, card):
                        print(f"eitsim: {sentence}", file=sys.stderr)
                last[:] = [step]
                show(step)

            yield follow
    except Stopped as stop:
        print(f"eitsim: stopped by {stop}; {last[0].done if last else 0} of {rows.scenes} scenes are in {out}. "
              "The same command goes on from there.", file=sys.stderr)
        raise typer.Exit(stop.status) from None


def measure(clean: Annotated[Path, typer.Argument(metavar="DIR", help="Data set of clean rows, as `sweep` writes it.")],
            out: Annotated[Path, typer.Option(help="Folder of the measured data set; an unfinished one is continued.")],
            model: Annotated[Path | None, typer.Option(help="Measurement (TOML) with one table [measurement]; else the "
                                                            "design's own.")] = None,
            as_json: JsonOption = False) -> None:
    """Turn clean rows into rows as an instrument gives them: noise, gain, drift, contact impedances, quantisation.

    A measurement is one table [measurement] with some of: snr_db and relative_to ("largest", "rms" or volts), or
    noise_V; frames, baseline_frames, clean_baseline; gain, offset_V; drift, drift_channel, drift_V, drift_channel_V;
    contact_impedance; bits and full_scale_V, or lsb_V; channels ("electrode"), seed. What is left out is off. For
    instance three lines: [measurement], snr_db = 90, relative_to = "rms".

    Example: eitsim measure sweep --model measurement.toml --out measured
    """
    from eitsim.sweeps.dataset.parquet import missing_rows, read_manifest
    from eitsim.sweeps.measurement.instrument_table import read_measurement
    from eitsim.sweeps.measurement.noise_summary import NoiseSummary, in_words
    from eitsim.sweeps.run.measure import measure as measure_rows
    from touchcal.terminal import counter

    check_out(out, folder=True)
    asked = read_measurement(model) if model is not None else None
    with counter(read_manifest(clean)["design"]["scenes"], "rows") as advance:
        found = measure_rows(clean, out, asked, progress=advance).manifest["measured"]
    if words := missing_rows(clean):
        print(f"eitsim: {clean}: {words}.", file=sys.stderr)
    if as_json:
        print_json({"out": out, **found})
    else:
        print(f"{out}: measured from {clean}\n{in_words(NoiseSummary(**found))}")


def indices(folder: Annotated[Path, typer.Argument(metavar="DIR", help="Data set of a design with sampler = \"nested\" "
                                                                       "and [material].")],
            out: Annotated[Path | None, typer.Option(help="Write the indices of every reading (CSV) here.")] = None,
            model: Annotated[Path | None, typer.Option(help="Measurement (TOML) with one table [measurement], whose "
                                                            "noise is a factor; else the design's own.")] = None,
            within: Annotated[list[str] | None, typer.Option(help="KEY=LOW,HIGH: touches over which the spread "
                                                                  "by the card alone is given; repeatable.")] = None,
            as_json: JsonOption = False) -> None:
    """Print how much of each output's variance comes from touch, material and noise: what calibration would gain.

    The estimate takes blocks of four rows, two touches with two cards each. 24 rows serve a try; useful intervals take
    some hundred blocks (400 rows) and draws = 20 or more in [material].

    Example: eitsim indices sweep --within F_N=0.9,1.1 --out indices.csv
    """
    from eitsim.sweeps.measurement.instrument_table import read_measurement
    from eitsim.sweeps.sobol.sobol_indices import indices_of, read_blocks
    from eitsim.sweeps.sobol.sobol_summary import document, show, write_csv

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [model] if model is not None else [])
    ranges = dict(_range(text) for text in within or [])
    blocks = read_blocks(folder, read_measurement(model) if model is not None else None)
    found = indices_of(blocks, within=ranges)
    shares = document(found, blocks)
    if out is not None:
        write_csv(found, out)
    if as_json:
        print_json(shares)
    else:
        show(shares)
        if out is not None:
            print(f"indices: {out}")


def _range(text: str) -> tuple[str, tuple[float, float]]:
    key, _, ends = text.partition("=")
    found = numbers(ends, "--within", "F_N=0.9,1.1") if key and ends else []
    if len(found) != 2 or found[0] > found[1]:
        raise ValueError(f"--within {text}: give KEY=LOW,HIGH, a key and its lowest and highest value, for example "
                         "F_N=0.9,1.1.")
    return key, (found[0], found[1])


def report(source: Annotated[Path, typer.Argument(metavar="DIR_OR_RESULT", help="Data set or result.json.")],
           out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write a PDF of one result or of a whole data set.

    Example: eitsim report sweep --out sweep.pdf
    """
    check_out(out)
    check_pdf(out, "--out")
    print(report_written(source, out))


def check_pdf(place: Path | None, flag: str) -> None:
    """ValueError where a file asked for is not named as a PDF."""
    if place is not None and place.suffix != ".pdf":
        raise ValueError(f"{flag} {place}: the file is a PDF; give a name that ends in .pdf.")


def report_written(source: Path, out: Path) -> str:
    """Write the PDF of a result or of a data set; what to tell of it."""
    from reports.sweep.sweep_report import write

    write(source, out)
    return f"report: {out}"
