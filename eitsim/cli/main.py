"""Command line of `eitsim`: plan, run, solve-mesh, reconstruct, cache, and the commands of data sets and reports."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eitsim.cli import sensor_commands
from eitsim.cli.fitted_card import warn_of_other_card
from eitsim.cli.identify_command import identify
from eitsim.cli.sweep_commands import check_pdf, indices, measure, report, report_written, sweep
from eitsim.scene.curved.curved_scene import AnyScene, read_any_scene
from eitsim.scene.scene import Scene, read_scene
from matcal.card import MaterialCard, read_card
from touchcal.errors import InputFileError, NotConverged
from touchcal.json_file import write_json
from touchcal.lazy import needed
from touchcal.terminal import JsonOption, application, check_apart, check_out, numbers, print_json, run, waiting
from touchcal.toml_file import read_toml

if TYPE_CHECKING:
    from eitsim.cli.output_files import OutputFiles
    from eitsim.scene.results import Result

app = application("Touch foam with a conductive skin: contact mechanics, skin conductance, electrode voltages.")

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")]
SceneOrDesign = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file, or design of a sweep (TOML).")]
CardOption = Annotated[Path | None, typer.Option("--card", help="Material card; else the scene's own `card` key.")]

LISTED = 30  # tables of the cache that fit one screen
GROWTH = ("note: the signal need not grow with the force here, as strain = \"normal\" drives the skin or a punch "
          "conducts: two forces may give one amplitude. `surrogate evaluate` of a model of a sweep over forces shows "
          "where.")


@app.command()
def plan(scene: SceneOrDesign, card: CardOption = None,
         verbose: Annotated[bool, typer.Option("--verbose", help="Also print the reason of each choice.")] = False,
         scenes: Annotated[int | None, typer.Option(help="Of a design: number of rows in place of its own.")] = None,
         workers: Annotated[int | None, typer.Option(min=1, help="Of a design: processes of the sweep; by default one "
                                                                 "for every processor.")] = None,
         reuse: Annotated[bool | None, typer.Option("--reuse/--no-reuse", help="Of a design: the option of the "
                                                    "sweep.")] = None,
         as_json: JsonOption = False) -> None:
    """Print what a scene needs and the error each omission may cost; nothing is solved. Of a design: rows, time,
    memory, disk and tables of its sweep on this machine, by up to 12 of its rows, which are solved.

    Example: eitsim plan scene.toml --card card.json

    Example: eitsim plan examples/design.toml --card card.json
    """
    from eitsim.cli.display import show_plan
    from eitsim.simulation.result_json import decisions
    from eitsim.simulation.simulate import plan as planned
    from eitsim.sweeps.design.design import is_design

    if scenes is not None or is_design(read_toml(scene)):
        _plan_design(scene, card, scenes, workers, reuse, as_json)
        return
    if workers is not None or reuse is not None:
        option = "--reuse" if workers is None else "--workers"
        raise ValueError(f"{scene} is a scene, and {option} is of designs. Leave it out, or give --scenes.")
    parsed = read_any_scene(scene)
    made = planned(parsed, _card_path(scene, parsed, card))
    if as_json:
        print_json({"plan": decisions(made), "error_bound": made.error_bound, "refusal": made.refusal})
    else:
        show_plan(made, reasons=verbose)
        if parsed.skin.strain == "normal" or any(punch.conductor for punch in parsed.punches):
            print(GROWTH)
    if made.refusal:
        raise ValueError(f"{scene}: {made.refusal}")


def _plan_design(path: Path, card: Path | None, scenes: int | None, workers: int | None, reuse: bool | None,
                 as_json: bool) -> None:
    from eitsim.sweeps.design.design import read_design
    from eitsim.sweeps.run.forecast import forecast, lines

    if card is None:
        raise ValueError(f"{path}: no card. Give --card card.json.")
    with waiting("solving some of the rows"):
        expected = forecast(read_design(path, scenes), read_card(card), workers or os.cpu_count() or 1, reuse)
    if as_json:
        print_json(asdict(expected) | {"wall_s": expected.wall_s})
    else:
        print(*lines(expected), sep="\n")


@app.command(name="run")
def run_scene(scene: SceneFile, card: CardOption = None,
              exact: Annotated[bool, typer.Option("--exact", help="Solve what the plan leaves out, where that is "
                                                  "built; the plan names what stays out.")] = False,
              reuse: Annotated[bool, typer.Option("--reuse", help="Take the touch from a stored load path of its "
                                                  "punch; the first one solves and keeps it.")] = False,
              out: Annotated[Path | None, typer.Option(help="Write the result (JSON) here.")] = None,
              fields: Annotated[Path | None, typer.Option(
                  help="Write stress and strain inside the foam (.vtu, for ParaView) here; or (.pvd) the press as a "
                       "series of its half-cut foam, punch and electrodes, for `eitsim draw` too.")] = None,
              fields_steps: Annotated[int | None, typer.Option(
                  help="Equal steps of the force, or depth, of a .pvd of --fields; 20 unless given.")] = None,
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
    """Solve one scene: depth, pressure, contact area and voltages (16 x 13 for the default sensor), each with its error
    estimate.

    Example: eitsim run scene.toml --card card.json --out result.json --report touch.pdf
    """
    from eitsim.cli.display import show_result
    from eitsim.cli.output_files import OutputFiles, check_output_files
    from eitsim.simulation.result_json import result_document
    from eitsim.simulation.simulate import simulate, solve_scene

    if report is not None and out is None:
        raise ValueError("--report needs --out: the report is made from the stored result. Add --out result.json.")
    parsed = read_any_scene(scene)
    files = OutputFiles(fields, frames, skin, _whole(skin_patterns, "--skin-patterns"), sensitivity, fields_steps)
    outs = {"--out": out, "--report": report, **files.places}
    for flag, place in outs.items():
        if place is not None:
            check_out(place, flag)
    path = _card_path(scene, parsed, card)
    check_apart(outs, (scene, path))
    check_pdf(report, "--report")
    if reuse and (exact or fields is not None):
        raise ValueError("--reuse takes the surface alone, from stored paths; leave it out with --exact and --fields.")
    check_output_files(parsed, files, outs)
    material = read_card(path)
    # fields inside the foam are those of touches about an axis, with what edges change: electrodes are no bodies there
    with waiting("solving the scene"):
        result = (solve_scene(parsed, material, exact=exact, bodies=False)
                  if fields is not None and isinstance(parsed, Scene)
                  else simulate(parsed, material, exact=exact, reuse=reuse))
    document = result_document(result, parsed, material)
    if result.outcome == "refused":
        raise ValueError(f"{scene}: {result.message}")
    if out is not None:
        write_json(document, out)
    if as_json:
        print_json(document)
    else:
        show_result(result, document, scene)
    for line in _write_files(parsed, result, document, material, files, out, report, exact):
        if not as_json:
            print(line)
    if result.outcome != "ok":
        raise NotConverged(f"{scene}: {result.outcome}: {result.message}")


def _write_files(scene: AnyScene, result: Result, document: dict[str, Any], card: MaterialCard,
                 files: OutputFiles, out: Path | None, report: Path | None, exact: bool) -> Iterator[str]:
    """Write what is requested next to a stored result, whose hash comes after the skin's file is named in it."""
    from eitsim.cli.output_files import write_output_files
    from touchcal.provenance import file_identity

    if result.readings is not None:
        for name, place in write_output_files(scene, result, card, files, exact=exact):
            drawing = f" (eitsim draw {place} --out {place.with_suffix('.png')} draws it)"
            yield f"{name}: {place}{drawing if place.suffix == '.pvd' else ''}"
    if out is None:
        return
    if result.readings is not None and files.skin is not None:
        write_json(document | {"skin_file": file_identity(files.skin, out.parent)}, out)
    yield f"result: {out} (sha256 {file_identity(out, out.parent)['sha256'][:12]})"
    if report is not None:
        yield report_written(out, report)


@app.command()
def draw(series: Annotated[Path, typer.Argument(metavar="SERIES", help="Series of a press (.pvd), from "
                                                                       "`eitsim run --fields press.pvd`.")],
         out: Annotated[Path, typer.Option(help="Write the picture of the last step (.png), or an animation of all "
                                                "(.gif), here.")]) -> None:
    """Draw a press in three dimensions: the half-cut foam as it is deformed, coloured by the strain that drives the
    skin, with punch and electrodes. Needs the extra `draw`: pip install '.[draw]' in the project's folder.

    Example: eitsim draw press.pvd --out press.png
    """
    needed("pyvista", "pictures in three dimensions")
    from reports.touch.press_picture import draw_press

    check_out(out)
    check_apart({"--out": out}, (series,))
    print(f"picture: {draw_press(series, out)}")


def _whole(text: str, flag: str) -> list[int] | None:
    """Whole numbers separated by commas; None of an empty text."""
    found = numbers(text, flag, "0,5") if text else []
    if not all(value.is_integer() for value in found):
        raise ValueError(f"{flag} must hold whole numbers, got {text}.")
    return [int(value) for value in found] or None


app.command()(sweep)
app.command()(measure)
app.command()(indices)
app.command()(identify)


@app.command(name="solve-mesh")
def solve_mesh(model: Annotated[Path, typer.Argument(
                   metavar="MODEL", help="EIDORS model (.mat, v5 to v7): a fwd_model, an image or an inv_model of a "
                                         "sheet, triangles in the plane; or a curved skin (.toml), triangles in "
                                         "space.")],
               variable: Annotated[str | None, typer.Option(help="Name of the model, where there are several.")] = None,
               conductance: Annotated[float | None, typer.Option(
                   "--conductance-S", help="One sheet conductance, S, in place of the image's elem_data.")] = None,
               scene: Annotated[Path | None, typer.Option(
                   help="Scene file whose [drive] takes the place of the model's stimulation.")] = None,
               element: Annotated[str, typer.Option(help="P1 solves what EIDORS solves; P2 puts quadratic elements on "
                                                         "the same triangles.")] = "P1",
               out: Annotated[Path | None, typer.Option(help="Write the result (JSON) here.")] = None,
               as_json: JsonOption = False) -> None:
    """Solve your own EIDORS model, or a curved skin: impedance matrix and readings, with what its triangles cost of
    them.

    Example: eitsim solve-mesh model.mat --conductance-S 1e-3 --out solved.json
    """
    from eitsim.electrics.interop import solve_file
    from eitsim.electrics.interop.eidors import read_eidors

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [path for path in (model, scene) if path is not None])
    if conductance is not None:
        solve_file.check_conductance(conductance, "--conductance-S")
    if model.suffix.lower() == ".toml":
        if variable is not None or scene is not None or element != "P1":
            raise ValueError(f"{model}: a curved skin takes no --variable, --scene and --element; leave them out.")
        _shown_solved(_curved(model, conductance), out, as_json)
        return
    solve_file.check_element(element)
    if scene is not None and (unused := solve_file.unused_tables(scene)):
        print(f"{scene}: of this file only [drive] is used; {', '.join(unused)} left out, since the model has its own.",
              file=sys.stderr)
    held = read_eidors(model, variable)
    solved = solve_file.solve_sheet_model(held, conductance_S=conductance, element=element,
                                          drive=read_scene(scene).drive if scene is not None else None)
    _shown_solved(solve_file.solved_document(model, held, conductance, element, solved), out, as_json)


def _curved(path: Path, conductance_S: float | None) -> dict[str, Any]:
    from eitsim.electrics.curved.solve_curved import curved_document, solve_curved_skin
    from eitsim.scene.curved_skin import read_curved_skin

    skin = read_curved_skin(path)
    skin = skin if conductance_S is None else replace(skin, conductance_S=conductance_S)
    return curved_document(path, skin, solve_curved_skin(skin))


def _shown_solved(document: dict[str, Any], out: Path | None, as_json: bool) -> None:
    from eitsim.cli.display import show_solved

    if out is not None:
        write_json(document, out)
    if as_json:
        print_json(document)
    else:
        show_solved(document, out)


@app.command()
def reconstruct(frames: Annotated[Path, typer.Argument(metavar="FRAMES", help="CSV of one row a frame, or a board's "
                                                                              "file (.mat, .npy ...); the first frame "
                                                                              "untouched.")],
                scene: Annotated[Path | None, typer.Option(
                    help="Scene or sensor file whose [body], [electrodes] and [drive] made the frames; else the "
                         "default ones.")] = None,
                baseline: Annotated[Path | None, typer.Option(
                    help="File of untouched frames, whose mean counts; else the first frame of FRAMES.")] = None,
                prior: Annotated[str, typer.Option(help="laplace, or noser, which rings less and places "
                                                         "touches worse.")] = "laplace",
                noise_figure: Annotated[float | None, typer.Option(
                    help="SNR of the readings over SNR of the image; smaller is smoother. By default 0.5, or the "
                         "nearest that can be had.", show_default=False)] = None,
                differences: Annotated[str, typer.Option(
                    help="volts; normalised, each over the untouched reading, where a gain of each cancels; auto: "
                         "normalised where no uniform skin explains the untouched frame.")] = "auto",
                out: Annotated[Path | None, typer.Option(help="Write the images (.vtu for ParaView, or .csv) "
                                                              "here.")] = None,
                as_json: JsonOption = False) -> None:
    """Images of the relative change of the skin's conductance: one regularised Gauss-Newton step from the untouched
    frame.

    Example: eitsim reconstruct frames.csv --scene scene.toml --out image.vtu
    """
    from eitsim.cli.display import show_images
    from eitsim.electrics.imaging.gauss_newton import check_prior
    from eitsim.electrics.imaging.images import check_differences, check_suffix, images_of, write_images
    from eitsim.sensors.formats.open_file import open_frames
    from eitsim.sensors.sensor_file import scene_of_frames

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [path for path in (frames, scene, baseline) if path is not None])
        check_suffix(out)
    check_prior(prior, noise_figure)
    check_differences(differences)
    sensor, kind = scene_of_frames(scene) if scene is not None else (Scene(), "voltage")
    images, document = images_of(frames, sensor, baseline=baseline, prior=prior, noise_figure=noise_figure, kind=kind,
                                 differences=differences, read=open_frames)
    if out is not None:
        write_images(images, out)
    if as_json:
        print_json(document)
    else:
        show_images(document, out)


@app.command()
def cache(clear: Annotated[bool, typer.Option("--clear", help="Remove the stored tables.")] = False,
          verbose: Annotated[bool, typer.Option("--verbose", help="List all.")] = False) -> None:
    """List the stored tables of load paths, the last used first, with --verbose all.

    Example: eitsim cache --clear
    """
    from touchcal import cache as stored

    entries = stored.entries()
    if clear:
        print(f"{stored.folder()}: removed {stored.clear()} tables, {sum(e.size_bytes for e in entries) / 1e6:.1f} MB")
        return
    print(f"{stored.folder()}: {len(entries)} tables, {sum(e.size_bytes for e in entries) / 1e6:.1f} MB")
    for entry in entries[:None if verbose else LISTED]:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used_s))
        print(f"{entry.path.stem[:12]}  {entry.size_bytes / 1e6:.1f} MB  last used {used}")


app.command()(report)
app.add_typer(sensor_commands.app, name="sensor")


def _card_path(scene_path: Path, scene: AnyScene, card: Path | None) -> Path:
    own = scene_path.parent / scene.card if scene.card is not None else None
    if card is not None:
        if own is not None and scene.channels.size_error:
            warn_of_other_card(card, own, scene.channels.size_error[0], "the plan")
        return card
    if own is None:
        raise ValueError(f"{scene_path}: no card. Give --card card.json, or card = \"card.json\" at its top.")
    if scene.channels.size_error and not own.exists():
        raise InputFileError(own, f"no such file, which the calibrated sensor in [electrodes] of {scene_path} names as "
                                  "the card of its skin, or `card` at its top. Put it there, fit the sensor again, or "
                                  "give --card.")
    return own


def main() -> None:
    run(app, "eitsim")
