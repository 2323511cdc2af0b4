"""Command line of `eitsim`: plan, run, sweep, indices, measure, report, solve-mesh, reconstruct, cache."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eitsim.scene import Scene, read_scene, scene_tables
from matcal.card import MaterialCard, read_card, write_json
from matcal.errors import NotConverged
from matcal.terminal import application, check_apart, check_out, numbers, print_json, run

if TYPE_CHECKING:
    from eitsim.beside import Beside
    from eitsim.results import Result

app = application("Touch a foam disc with a conductive skin: contact mechanics, skin conductance, 208 voltages.")

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")]
CardOption = Annotated[Path | None, typer.Option("--card", help="Material card; else the scene's own `card` key.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


@app.command()
def plan(scene: SceneFile, card: CardOption = None, as_json: JsonOption = False) -> None:
    """Print what a scene needs, why, and the error each omission may cost; nothing is solved.

    Example: eitsim plan scene.toml --card card.json
    """
    from eitsim.display import show_plan
    from eitsim.document import decisions
    from eitsim.plan import make_plan

    parsed = read_scene(scene)
    made = make_plan(parsed, read_card(_card_path(scene, parsed, card)))
    if as_json:
        print_json({"plan": decisions(made), "error_bound": made.error_bound, "refusal": made.refusal})
    else:
        show_plan(made)
    if made.refusal:
        raise ValueError(f"{scene}: {made.refusal}")


@app.command(name="run")
def run_scene(scene: SceneFile, card: CardOption = None,
              exact: Annotated[bool, typer.Option("--exact", help="Turn off what the plan leaves out where that is "
                                                  "built; the plan tells what stays.")] = False,
              reuse: Annotated[bool, typer.Option("--reuse", help="Take the touch from a stored load path of its "
                                                  "punch; the first one solves and keeps it.")] = False,
              out: Annotated[Path | None, typer.Option(help="Write the result (JSON) here.")] = None,
              fields: Annotated[Path | None, typer.Option(
                  help="Write stress and strain inside the foam (VTU, for ParaView) here.")] = None,
              frames: Annotated[Path | None, typer.Option(
                  help="Write the untouched and the touched voltages (CSV, a row each) here.")] = None,
              skin: Annotated[Path | None, typer.Option(
                  help="Write potential, current density and conductance on the skin (VTU, for ParaView) here; of a "
                       "hold at its end.")] = None,
              skin_patterns: Annotated[str, typer.Option(
                  help="Patterns of --skin, from 0, separated by commas; else all.")] = "",
              sensitivity: Annotated[Path | None, typer.Option(
                  help="Write the readings' derivatives by touch, card and contact impedances (CSV) here.")] = None,
              report: Annotated[Path | None, typer.Option(help="Write a PDF report here; needs --out.")] = None,
              as_json: JsonOption = False) -> None:
    """Solve one scene: depth, pressure, contact area and voltages (16 x 13 unless [drive] says otherwise), each with
    its error estimate.

    Example: eitsim run scene.toml --card card.json --out result.json --report touch.pdf
    """
    from eitsim.beside import Beside, check_beside
    from eitsim.display import show_result

    if report is not None and out is None:
        raise ValueError("--report needs --out: the report is made from the stored result. Add --out result.json.")
    parsed = read_scene(scene)
    beside = Beside(fields, frames, skin, _whole(skin_patterns, "--skin-patterns"), sensitivity)
    outs = {"--out": out, "--report": report, **beside.places}
    for flag, place in outs.items():
        if place is not None:
            check_out(place, flag)
    path = _card_path(scene, parsed, card)
    check_apart(outs, (scene, path))
    _check_pdf(report, "--report")
    if reuse and (exact or fields is not None):
        raise ValueError("--reuse takes the surface alone, from stored paths; leave it out with --exact and --fields.")
    check_beside(parsed, beside)
    result, document, note = _solve(parsed, path, exact, reuse)
    if note:
        print(note, file=sys.stderr)
    if result.outcome == "refused":
        raise ValueError(f"{scene}: {result.message}")
    if out is not None:
        write_json(document, out)
    if as_json:
        print_json(document)
    else:
        show_result(result, document)
    for line in _write_files(parsed, result, document, path, beside, out, report):
        if not as_json:
            print(line)
    if result.outcome != "ok":
        raise NotConverged(f"{scene}: {result.outcome}: {result.message}")


def _write_files(scene: Scene, result: Result, document: dict[str, Any], card: Path, beside: Beside, out: Path | None,
                 report: Path | None) -> Iterator[str]:
    """Write what is asked for beside a stored result, whose hash comes after the skin's file is named in it."""
    from eitsim.beside import write_beside
    from eitsim.provenance import file_identity

    if result.readings is not None:
        yield from (f"{name}: {place}" for name, place in write_beside(scene, result, read_card(card), beside))
    if out is None:
        return
    if result.readings is not None and beside.skin is not None:
        write_json(document | {"skin_file": file_identity(beside.skin, out.parent)}, out)
    yield f"result: {out} (sha256 {file_identity(out, out.parent)['sha256'][:12]})"
    if report is not None:
        yield _report_written(out, report)


def _whole(text: str, flag: str) -> list[int] | None:
    """Whole numbers separated by commas; None of an empty text."""
    found = numbers(text, flag, "0,5") if text else []
    if any(value != int(value) for value in found):
        raise ValueError(f"{flag} must hold whole numbers, got {text}.")
    return [int(value) for value in found] or None


def _solve(scene: Scene, card_path: Path, exact: bool, reuse: bool) -> tuple[Result, dict[str, Any], str]:
    """The result, its document, and a note on the load path where one was asked for."""
    from eitsim.document import as_json
    from eitsim.provenance import card_identity, versions
    from eitsim.reuse import scene_shape, table_for
    from eitsim.simulate import simulate

    card: MaterialCard = read_card(card_path)
    table, note = table_for(scene_shape(scene, card)) if reuse else (None, "")
    result = simulate(scene, card, exact=exact, table=table)
    document = {"schema": 1, "scene": scene_tables(scene), "card": card_identity(card, card_path),
                "versions": versions()} | as_json(result, scene, card)
    return result, document, note and f"load path: {note}"


@app.command()
def sweep(design: Annotated[Path, typer.Argument(metavar="DESIGN", help="Design file (TOML), or a table of scenes "
                                                                              "(CSV, one row a scene).")],
          card: Annotated[Path, typer.Option(help="Material card.")],
          out: Annotated[Path, typer.Option(help="Folder of the data set; an unfinished one is continued.")],
          scenes: Annotated[int | None, typer.Option(help="Number of scenes, over the design's own.")] = None,
          scene: Annotated[Path | None, typer.Option("--scene", help="With a table: scene file of what its columns "
                                                     "leave out; seed and [material] too.")] = None,
          reuse: Annotated[bool | None, typer.Option("--reuse/--no-reuse", help="Take touches from a table of load "
                                                     "paths; by default where that repays its cost.")] = None,
          exact: Annotated[bool, typer.Option("--exact", help="Solve every row as `run --exact` does.")] = False,
          other_code: Annotated[bool, typer.Option("--other-code", help="Continue a folder that other code or "
                                                   "libraries made; it then tells which scenes are whose.")] = False,
          workers: Annotated[int | None, typer.Option(help="Processes, one thread each; by default one for every "
                                                      "processor.")] = None,
          scheduler: Annotated[str | None, typer.Option(help="Address of a dask scheduler whose workers solve the "
                                                        "scenes, in place of --workers.")] = None,
          log_every: Annotated[float, typer.Option("--log-every", metavar="SECONDS", help="Where standard error is no "
                                                   "terminal, a line of progress so often, for logs of a cluster; 0 "
                                                   "for none.")] = 0.0,
          report: Annotated[Path | None, typer.Option(help="Write a PDF report of the data set here, at the "
                                                           "end.")] = None,
          as_json: JsonOption = False) -> None:
    """Solve many scenes into Parquet parts; started again on the same folder, it goes on where it was. At the end it
    tells outcomes, errors of the signal, and what each stage cost.

    In a design any scalar of a scene may be a range [lo, hi], {choice = [...]} or {dist = "normal", mean = , sd = } (or
    lognormal, uniform, loguniform, integer; lo and hi cut off), by chance, or {list = [...]}, whose combinations are
    gone through. [punch] place = {grid = "polar", spacing_mm = 10} (or square; sunflower with count) or {list =
    [[x, y], ...]} are lists of places; without place, x_mm and y_mm touches are uniform over the disc. touches = [1, 2]
    draws their number. A table has columns x_mm, y_mm, d_mm, F_N, any key of [punch], skin.thickness_um and so on, and
    x_2_mm, punch_2_profile of further touches.

    Example: eitsim sweep design.toml --card card.json --scenes 200 --workers 2 --out sweep

    Example: eitsim sweep scenes.csv --scene scene.toml --card card.json --out sweep
    """
    from eitsim.cluster import cluster
    from eitsim.design import read_design
    from eitsim.scene_table import read_scene_table
    from eitsim.sweep import Progress
    from eitsim.sweep import sweep as steps
    from eitsim.sweep_account import account_of, document, lines
    from eitsim.sweep_progress import in_words, shown
    from matcal.stopping import Stopped, stoppable

    check_out(out, folder=True)
    if report is not None:
        check_out(report, "--report")
        check_apart({"--report": report}, [path for path in (design, card, scene) if path is not None])
        _check_pdf(report, "--report")
    if workers is not None and scheduler is not None:
        raise ValueError("--workers and --scheduler exclude each other: a cluster has workers of its own. Leave one "
                         "out.")
    count = workers if workers is not None else os.cpu_count() or 1
    if scene is not None and design.suffix != ".csv":
        raise ValueError(f"--scene goes with a table of scenes (.csv); {design} holds the tables of a scene itself.")
    plan_of_rows = read_scene_table(design, scene, scenes) if design.suffix == ".csv" else read_design(design, scenes)
    begun, last, account = time.perf_counter(), None, None
    try:
        with stoppable(), shown(plan_of_rows.scenes, log_every) as show:
            for step in steps(plan_of_rows, card, out, workers=count, reuse=reuse, exact=exact,
                              other_code=other_code,
                              crew=cluster(scheduler) if scheduler is not None else None):
                if isinstance(step, Progress):
                    last = step
                    show(step)
                else:
                    account = step
    except Stopped as stop:
        print(f"eitsim: stopped by {stop}; {last.done if last else 0} of {plan_of_rows.scenes} scenes are in {out}. "
              "The same command goes on from there.", file=sys.stderr)
        raise typer.Exit(stop.status) from None
    assert account is not None
    spent, found = time.perf_counter() - begun, account_of(out)
    if as_json:
        print_json({"out": out, "wall_s": spent, "solved": account.solved, "kept": account.kept,
                    "method": account.method, "reasons": dict(account.reasons)} | document(found))
    else:
        by = f"{count} worker(s)" if scheduler is None else scheduler
        print(f"{out}: {account.solved} scenes finished in {spent:.1f} s on {by}, {account.kept} were there; outcomes: "
              f"{in_words(account.outcomes)}.")
        print(account.method)
        for name, message in sorted(account.reasons.items()):
            print(f"first \"{name}\": {message}")
        print("\n".join(lines(found)))
    if report is not None:
        written = _report_written(out, report)
        if not as_json:
            print(written)


@app.command()
def measure(clean: Annotated[Path, typer.Argument(metavar="DIR", help="Data set of clean rows, as `sweep` writes it.")],
            out: Annotated[Path, typer.Option(help="Folder of the measured data set; an unfinished one is continued.")],
            model: Annotated[Path | None, typer.Option(help="Measurement (TOML) with one table [measurement]; else the "
                                                            "design's own.")] = None,
            as_json: JsonOption = False) -> None:
    """Turn clean rows into rows as an instrument gives them: noise, gain, drift, contact impedances, quantisation.

    Example: eitsim measure sweep --model measurement.toml --out measured
    """
    from eitsim.dataset import read_manifest
    from eitsim.measured_set import measure as steps
    from eitsim.measurement_account import Told, in_words
    from eitsim.measurement_file import read_measurement
    from matcal.terminal import counter

    check_out(out, folder=True)
    asked = read_measurement(model) if model is not None else None
    told = None
    with counter(read_manifest(clean)["design"]["scenes"], "rows") as advance:
        for step in steps(clean, out, asked):
            if isinstance(step, Told):
                told = step
            else:
                advance(step)
    if told is not None and as_json:
        print_json({"out": out, **vars(told)})
    elif told is not None:
        print(f"{out}: measured from {clean}\n{in_words(told)}")


@app.command()
def indices(folder: Annotated[Path, typer.Argument(metavar="DIR", help="Data set of a design with sampler = \"nested\" "
                                                                       "and [material].")],
            out: Annotated[Path | None, typer.Option(help="Write the indices of every reading (CSV) here.")] = None,
            model: Annotated[Path | None, typer.Option(help="Measurement (TOML) with one table [measurement], whose "
                                                            "noise is a factor; else the design's own.")] = None,
            within: Annotated[list[str] | None, typer.Option(help="KEY=LOWEST,HIGHEST: touches over which the spread "
                                                                  "by the card alone is told; repeatable.")] = None,
            as_json: JsonOption = False) -> None:
    """Tell how much of each output's variance touch, material and noise make: what calibration would buy.

    Example: eitsim indices sweep --within F_N=0.9,1.1 --out indices.csv
    """
    from eitsim.indices import indices_of, read_blocks
    from eitsim.indices_account import document, show, write_csv
    from eitsim.measurement_file import read_measurement

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [path for path in (model,) if path is not None])
    ranges = dict(_range(text) for text in within or [])
    blocks = read_blocks(folder, read_measurement(model) if model is not None else None)
    found = indices_of(blocks, within=ranges)
    told = document(found, blocks)
    if out is not None:
        write_csv(found, out)
    if as_json:
        print_json(told)
    else:
        show(told)
        if out is not None:
            print(f"indices: {out}")


def _range(text: str) -> tuple[str, tuple[float, float]]:
    """Key and ends of a range KEY=LOWEST,HIGHEST."""
    key, _, ends = text.partition("=")
    found = numbers(ends, "--within", "F_N=0.9,1.1")
    if len(found) != 2 or found[0] > found[1]:
        raise ValueError(f"--within {text}: give a key and the lowest and the highest value, for example F_N=0.9,1.1.")
    return key, (found[0], found[1])


@app.command(name="solve-mesh")
def solve_mesh(model: Annotated[Path, typer.Argument(
                   metavar="MODEL", help="EIDORS model (.mat, v5 to v7): a fwd_model, an image or an inv_model of a "
                                         "sheet, triangles in the plane.")],
               variable: Annotated[str | None, typer.Option(help="Name of the model, where there are several.")] = None,
               conductance: Annotated[float | None, typer.Option(
                   "--conductance-S", help="One sheet conductance, S, in place of the image's elem_data.")] = None,
               scene: Annotated[Path | None, typer.Option(
                   help="Scene file whose [drive] takes the place of the model's stimulation.")] = None,
               element: Annotated[str, typer.Option(help="P1 solves what EIDORS solves; P2 puts quadratic elements on "
                                                         "the same triangles.")] = "P1",
               out: Annotated[Path | None, typer.Option(help="Write the result (JSON) here.")] = None,
               as_json: JsonOption = False) -> None:
    """Solve your own EIDORS model: impedance matrix and readings, with what its triangles cost of them.

    Example: eitsim solve-mesh model.mat --conductance-S 1e-3 --out solved.json
    """
    from eitsim.display import show_solved
    from eitsim.mesh_model import check_element
    from eitsim.solve_mesh import check_conductance, solve_file, unused_tables

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [path for path in (model, scene) if path is not None])
    check_element(element)
    if conductance is not None:
        check_conductance(conductance, "--conductance-S")
    if scene is not None and (unused := unused_tables(scene)):
        print(f"{scene}: of this file only [drive] is used; {', '.join(unused)} left out, since the model has its own.",
              file=sys.stderr)
    document = solve_file(model, variable, conductance, read_scene(scene).drive if scene is not None else None, element)
    if out is not None:
        write_json(document, out)
    if as_json:
        print_json(document)
    else:
        show_solved(document, out)


@app.command()
def reconstruct(frames: Annotated[Path, typer.Argument(metavar="FRAMES", help="CSV of one row a frame, the first one "
                                                                              "untouched.")],
                scene: Annotated[Path | None, typer.Option(
                    help="Scene file whose [body], [electrodes] and [drive] made the frames; else the default "
                         "ones.")] = None,
                baseline: Annotated[Path | None, typer.Option(
                    help="CSV of untouched frames, whose mean counts; else the first row of FRAMES.")] = None,
                prior: Annotated[str, typer.Option(help="laplace, or noser, which rings less and places "
                                                         "touches worse.")] = "laplace",
                noise_figure: Annotated[float, typer.Option(
                    help="SNR of the readings over SNR of the image; smaller is smoother. For 16 "
                         "electrodes 0.08 to 100 can be had.")] = 0.5,
                out: Annotated[Path | None, typer.Option(help="Write the images (.vtu for ParaView, or .csv) "
                                                              "here.")] = None,
                as_json: JsonOption = False) -> None:
    """Images of the relative change of the skin's conductance: one regularised Gauss-Newton step from the untouched
    frame.

    Example: eitsim reconstruct frames.csv --scene scene.toml --out image.vtu
    """
    from eitsim.display import show_images
    from eitsim.frame_images import check_suffix, images_of, write_images
    from eitsim.reconstruction import check_wanted

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [path for path in (frames, scene, baseline) if path is not None])
        check_suffix(out)
    check_wanted(prior, noise_figure)
    pixels, images, document = images_of(frames, read_scene(scene) if scene is not None else Scene(),
                                         baseline=baseline, prior=prior, noise_figure=noise_figure)
    if out is not None:
        write_images(pixels, images, out)
    if as_json:
        print_json(document)
    else:
        show_images(document, out)


@app.command()
def cache(clear: Annotated[bool, typer.Option("--clear", help="Remove the stored tables.")] = False) -> None:
    """List the stored tables of load paths, the last used first.

    Example: eitsim cache --clear
    """
    from eitsim import cache as stored

    entries = stored.entries()
    if clear:
        print(f"{stored.folder()}: removed {stored.clear()} tables, {sum(e.size_bytes for e in entries) / 1e6:.1f} MB")
        return
    print(f"{stored.folder()}: {len(entries)} tables, {sum(e.size_bytes for e in entries) / 1e6:.1f} MB")
    for entry in entries:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used_s))
        print(f"{entry.path.stem[:12]}  {entry.size_bytes / 1e6:.1f} MB  last used {used}")


@app.command()
def report(source: Annotated[Path, typer.Argument(metavar="DIR_OR_RESULT", help="Data set or result.json.")],
           out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write a PDF of one result or of a whole data set.

    Example: eitsim report sweep --out sweep.pdf
    """
    check_out(out)
    _check_pdf(out, "--out")
    print(_report_written(source, out))


def _check_pdf(place: Path | None, flag: str) -> None:
    if place is not None and place.suffix != ".pdf":
        raise ValueError(f"{flag} {place}: the file is a PDF; give a name that ends in .pdf.")


def _report_written(source: Path, out: Path) -> str:
    from reports.simulation import write

    write(source, out)
    return f"report: {out}"


def _card_path(scene_path: Path, scene: Scene, card: Path | None) -> Path:
    if card is not None:
        return card
    if scene.card is None:
        raise ValueError(f"{scene_path}: no card. Give --card card.json, or card = \"card.json\" at its top.")
    return scene_path.parent / scene.card


def main() -> None:
    """Entry point."""
    run(app, "eitsim")
