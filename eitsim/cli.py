"""Command line of `eitsim`: plan, run, sweep, report, solve-mesh, reconstruct, cache."""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eitsim.scene import Scene, read_scene, scene_tables
from matcal.card import MaterialCard, read_card, require, write_json
from matcal.errors import NotConverged
from matcal.terminal import application, check_out, numbers, print_json, run

if TYPE_CHECKING:
    from rich.table import Table

    from eitsim.results import Plan, Result

app = application("Touch a foam disc with a conductive skin: contact mechanics, skin conductance, 208 voltages.")

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")]
CardOption = Annotated[Path | None, typer.Option("--card", help="Material card; else the scene's own `card` key.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


@app.command()
def plan(scene: SceneFile, card: CardOption = None, as_json: JsonOption = False) -> None:
    """Print what a scene needs, why, and the error each omission may cost; nothing is solved.

    Example: eitsim plan scene.toml --card card.json
    """
    from eitsim.plan import make_plan
    from eitsim.simulate import decisions

    parsed = read_scene(scene)
    made = make_plan(parsed, read_card(_card_path(scene, parsed, card)))
    if as_json:
        print_json({"plan": decisions(made), "error_bound": made.error_bound, "refusal": made.refusal})
    else:
        _print_plan(made)
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
    if report is not None and out is None:
        raise ValueError("--report needs --out: the report is made from the stored result. Add --out result.json.")
    for place, flag in ((out, "--out"), (fields, "--fields"), (frames, "--frames"), (skin, "--skin"),
                        (sensitivity, "--sensitivity"), (report, "--report")):
        if place is not None:
            check_out(place, flag)
    parsed, patterns = read_scene(scene), _whole(skin_patterns, "--skin-patterns")
    _check_fields(parsed, fields, exact, reuse)
    _check_beside(parsed, skin, patterns, sensitivity)
    path = _card_path(scene, parsed, card)
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
        _print_result(result, document, out)
    if result.readings is not None:
        for name, place in _written(parsed, result, path, fields, frames, skin, patterns, sensitivity):
            if not as_json:
                print(f"{name}: {place}")
        if skin is not None and out is not None:
            from eitsim.provenance import file_identity

            write_json(document | {"skin_file": file_identity(skin, out.parent)}, out)
    if report is not None and out is not None:
        _write_report(out, report)
    if result.outcome != "ok":
        raise NotConverged(f"{scene}: {result.outcome}: {result.message}")


def _whole(text: str, flag: str) -> list[int] | None:
    """Whole numbers separated by commas; None of an empty text."""
    found = numbers(text, flag, "0,5") if text else []
    if any(value != int(value) for value in found):
        raise ValueError(f"{flag} must hold whole numbers, got {text}.")
    return [int(value) for value in found] or None


def _check_fields(scene: Scene, fields: Path | None, exact: bool, reuse: bool) -> None:
    """ValueError where these options do not go together."""
    if fields is not None:
        _check_vtu(fields, "--fields")
        if scene.hold.time_s:
            raise ValueError("--fields is not built for a hold; leave out time_s in [hold].")
        if len(scene.punches) > 1:
            raise ValueError("--fields is built for one touch; leave it out or give one [punch].")
    if reuse and (exact or fields is not None):
        raise ValueError("--reuse takes the surface alone, from stored paths; leave it out with --exact and --fields.")


def _check_beside(scene: Scene, skin: Path | None, patterns: list[int] | None, sensitivity: Path | None) -> None:
    """ValueError, before anything is solved, where the scene has no such file."""
    if skin is None and patterns is not None:
        raise ValueError("--skin-patterns has no effect without --skin; add --skin skin.vtu.")
    if skin is not None:
        from eitsim.skin_fields import driven_currents

        _check_vtu(skin, "--skin")
        driven_currents(scene, patterns)
    if sensitivity is not None:
        from eitsim.touch_sensitivity import check_differentiable

        check_differentiable(scene)


def _check_vtu(path: Path, flag: str) -> None:
    if path.suffix != ".vtu":
        raise ValueError(f"{flag} {path}: the file is a VTU file; give a name that ends in .vtu.")


def _written(scene: Scene, result: Result, card: Path, fields: Path | None, frames: Path | None, skin: Path | None,
             patterns: list[int] | None, sensitivity: Path | None) -> Iterator[tuple[str, Path]]:
    """Write the files that are asked for beside a solved result; what each is, and where."""
    if fields is not None:
        from eitsim.fields import write_vtu

        (touch,) = result.touches
        write_vtu(touch, fields)
        yield "fields", fields
    if frames is not None and result.readings is not None:
        from eitsim.frames import write_frames

        write_frames(frames, [moment.readings for moment in result.moments] or [result.readings])
        yield "frames", frames
    if skin is not None:
        from eitsim.skin_fields import write_skin_vtu

        write_skin_vtu(scene, result.touches, require(read_card(card), "conductivity", "the skin"), skin, patterns)
        yield "skin", skin
    if sensitivity is not None and result.outcome == "ok":
        from eitsim.touch_sensitivity import scene_sensitivity, write_sensitivity

        write_sensitivity(scene_sensitivity(scene, read_card(card)), sensitivity)
        yield "sensitivity", sensitivity


def _solve(scene: Scene, card_path: Path, exact: bool, reuse: bool) -> tuple[Result, dict[str, Any], str]:
    """The result, its document, and a note on the load path where one was asked for."""
    from eitsim.provenance import card_identity, versions
    from eitsim.reuse import scene_shape, table_for
    from eitsim.simulate import as_json, simulate

    card: MaterialCard = read_card(card_path)
    table, note = table_for(scene_shape(scene, card)) if reuse else (None, "")
    result = simulate(scene, card, exact=exact, table=table)
    document = {"schema": 1, "scene": scene_tables(scene), "card": card_identity(card, card_path),
                "versions": versions()} | as_json(result, scene, card)
    return result, document, note and f"load path: {note}"


@app.command()
def sweep(design: Annotated[Path, typer.Argument(metavar="DESIGN", help="Design file (TOML).")],
          card: Annotated[Path, typer.Option(help="Material card.")],
          out: Annotated[Path, typer.Option(help="Folder of the data set; an unfinished one is continued.")],
          scenes: Annotated[int | None, typer.Option(help="Number of scenes, over the design's own.")] = None,
          reuse: Annotated[bool | None, typer.Option("--reuse/--no-reuse", help="Take touches from a table of load "
                                                     "paths; by default where that repays its cost.")] = None,
          exact: Annotated[bool, typer.Option("--exact", help="Solve every row as `run --exact` does.")] = False,
          workers: Annotated[int, typer.Option(help="Processes.")] = os.cpu_count() or 1) -> None:
    """Solve many scenes into Parquet parts; started again on the same folder, it goes on where it was.

    Example: eitsim sweep design.toml --card card.json --scenes 200 --workers 2 --out sweep
    """
    from eitsim.design import read_design
    from eitsim.sweep import Account
    from eitsim.sweep import sweep as steps
    from matcal.terminal import counter

    check_out(out, folder=True)
    plan_of_rows = read_design(design, scenes)
    begun = time.perf_counter()
    account = None
    with counter(plan_of_rows.scenes, "scenes") as advance:
        for step in steps(plan_of_rows, card, out, workers=workers, reuse=reuse, exact=exact):
            if isinstance(step, Account):
                account = step
            else:
                advance(step)
    if account is not None:
        spent = time.perf_counter() - begun
        counts = ", ".join(f"{n} {name}" for name, n in sorted(account.outcomes.items()))
        print(f"{out}: {account.solved} scenes finished in {spent:.1f} s on {workers} worker(s), {account.kept} were "
              f"there; outcomes: {counts}.")
        print(account.method)
        for name, message in sorted(account.reasons.items()):
            print(f"first \"{name}\": {message}")


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
    from eitsim.solve_mesh import solve_file

    if out is not None:
        check_out(out)
    document = solve_file(model, variable, conductance, read_scene(scene).drive if scene is not None else None, element)
    if out is not None:
        write_json(document, out)
    if as_json:
        print_json(document)
    else:
        _print_solved(document, out)


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
                    help="SNR of the readings over SNR of the image; smaller is smoother.")] = 0.5,
                out: Annotated[Path | None, typer.Option(help="Write the images (.vtu for ParaView, or .csv) "
                                                              "here.")] = None,
                as_json: JsonOption = False) -> None:
    """Images of the relative change of the skin's conductance: one regularised Gauss-Newton step from the untouched
    frame.

    Example: eitsim reconstruct frames.csv --scene scene.toml --out image.vtu
    """
    from eitsim.frame_images import check_suffix, images_of, write_images

    if out is not None:
        check_out(out)
        check_suffix(out)
    pixels, images, document = images_of(frames, read_scene(scene) if scene is not None else Scene(),
                                         baseline=baseline, prior=prior, noise_figure=noise_figure)
    if out is not None:
        write_images(pixels, images, out)
    if as_json:
        print_json(document)
    else:
        _print_images(document, out)


def _print_images(document: dict[str, Any], out: Path | None) -> None:
    from rich.console import Console
    from rich.table import Table

    keys = ("line", "x_mm", "y_mm", "area_mm2", "peak")
    table = Table(*keys, title="images: quarter-amplitude area, its centre, largest relative change of conductance")
    for image in document["frames"]:
        table.add_row(*(f"{image[key]:.4g}" for key in keys))
    Console().print(table)
    print(f"untouched: {document['conductance_S']:.4g} S a square, misfit {document['misfit']:.2%}; prior "
          f"{document['prior']}, noise figure {document['noise_figure']:.3g}")
    if out is not None:
        print(f"images: {out}")


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
    _write_report(source, out)


def _write_report(source: Path, out: Path) -> None:
    from reports.simulation import write

    write(source, out)
    print(f"report: {out}")


def _card_path(scene_path: Path, scene: Scene, card: Path | None) -> Path:
    if card is not None:
        return card
    if scene.card is None:
        raise ValueError(f"{scene_path}: no card. Give --card card.json, or card = \"card.json\" at its top.")
    return scene_path.parent / scene.card


def _print_plan(made: Plan) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table("decision", "reason", "may cost of dV", title="plan")
    for d in made.decisions:
        table.add_row(escape(d.decision), escape(d.reason), f"{d.error_bound:.1e}" if d.error_bound else "-")
    table.add_section()
    table.add_row("all of them", "", f"{made.error_bound:.1e}")
    Console().print(table)


def _print_result(result: Result, document: dict[str, Any], out: Path | None) -> None:
    from rich.console import Console
    from rich.table import Table

    _print_plan(result.plan)
    if result.readings is not None:
        largest_V = max(abs(value) for value in result.readings.signal_V.flat if value == value)
        table = Table("quantity", "value", title=f"touch: {result.outcome}")
        for key in ("force_N", "delta_max_mm", "sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "wall_contact_mm2"):
            values = document[key] if isinstance(document[key], list) else [document[key]]
            table.add_row(key, ", ".join(f"{value:.5g}" for value in values))
        table.add_row("largest |dV|, mV", f"{largest_V * 1e3:.4g}")
        for key, value in result.error_estimate.items():
            table.add_row(f"error of {key}, of that numerical", f"{value:.2%}, {result.numerical_error[key]:.2%}")
        for key, value in result.interaction.items():
            table.add_row(f"of it at most by neighbours, {key}", f"{value:.2%}")
        _add_ranges(table, document["stability"])
        table.add_row("CPU, s", f"{result.cost['cpu_s']:.2f}")
        Console().print(table)
        if result.outcome == "ok" and result.message:
            print(f"note: {result.message}")
    if result.moments:
        Console().print(_hold_table(document["times"]))
    if out is not None:
        print(f"result: {out} (sha256 {hashlib.sha256(out.read_bytes()).hexdigest()[:12]})")


def _print_solved(document: dict[str, Any], out: Path | None) -> None:
    from rich.console import Console
    from rich.table import Table

    made, errors = document["model"], document["error_estimate"]
    table = Table("quantity", "value", title=f"{made['file']}: {made['variable']}")
    for name in ("electrodes", "nodes", "triangles"):
        table.add_row(name, str(made[name]))
    table.add_row("sheet conductance, S", " to ".join(f"{value:.5g}" for value in made["conductance_S"]))
    table.add_row("readings", str(sum(len(row) for row in document["readings_V"])) if document["readings_V"] else
                  "none: the model has no stimulation (--scene gives one)")
    for key, value in errors.items():
        table.add_row(f"error of {key} by the triangles", f"{value:.2e}")
    table.add_row("CPU, s", f"{document['cost']['cpu_s']:.2f}")
    Console().print(table)
    if out is not None:
        print(f"result: {out}")


def _hold_table(times: list[dict[str, Any]]) -> Table:
    """The hold, one row a time after loading."""
    from rich.table import Table

    keys = ("time_s", "delta_max_mm", "force_N", "sigma_ave_kPa", "sigma_max_kPa", "A_c_mm2")
    table = Table(*keys, title="hold, from the end of loading")
    for block in times:
        table.add_row(*(f"{block[key]:.5g}" for key in keys))
    return table


def _add_ranges(table: Table, stability: dict[str, Any]) -> None:
    """Rows that set the least strain against the fitted ones; beyond them the laws are extrapolated."""
    table.add_row("least strain of the surface", f"{stability['least_strain']:.3f}")
    for part in ("foam", "skin"):
        fitted = stability[f"fitted_{part}_strain"]
        told = "not stated by the card"
        if fitted is not None:
            told = " to ".join(f"{round(end, 3) + 0.0:g}" for end in fitted)
        beyond = fitted is not None and stability["least_strain"] < fitted[0]
        table.add_row(f"{part} law fitted over", told + (", extrapolated" if beyond else ""))
    table.add_row("skin beyond its fit", f"{stability['skin_fraction_extrapolated']:.2%} of the disc")


def main() -> None:
    """Entry point."""
    run(app, "eitsim")
