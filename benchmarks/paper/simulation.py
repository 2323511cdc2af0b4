"""Sections of the simulation: potentials, meshes, convergence, holds, readings and maps (paper, figures 1, 7 to 11)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.paper import meshes as paper_meshes
from benchmarks.paper import touches
from benchmarks.paper.loading import LOST, WITHIN_S
from benchmarks.paper.section import Number, Section, against, paper_value, renamed, value_of
from benchmarks.paper.stages_plan import CONVERGENCE, FIRST, HOLDS, LOADING, SECOND, TOUCH, Run
from reports.document.numerals import number, percent, volts
from reports.document.provenance import source
from reports.touch import reading_figures, skin_maps
from reports.touch.touch_report import read_result
from touchcal.errors import InputFileError

LAST_S = 180.0


def result_of(run: Run, name: str) -> dict[str, Any] | None:
    """The result of a stage that runs one scene; None where it is not there."""
    path = run.stages[name].folder / "touch.json"
    return read_result(path) if path.is_file() else None


def skin_of(run: Run, name: str, result: Mapping[str, Any]) -> Path:
    """The file of the skin that a result names; InputFileError where it is another than was written with it."""
    path = run.stages[name].folder / "skin.vtu"
    if not path.is_file() or source(path).sha256 != result["skin_file"]["sha256"]:
        raise InputFileError(path, "it is not the file that was written with touch.json. Delete the folder and run the "
                                   "report again.")
    return path


def absent(figure: str, title: str, *stages: str) -> Section:
    """A section whose results are not there."""
    return Section(figure, title, "", "", "", stages, missing=f"Not there: {' and '.join(stages)} was not run.")


def potentials(run: Run) -> Section:
    """Figure 1: equipotential lines of two patterns."""
    title = "equipotential lines with and without a touch"
    if (result := result_of(run, TOUCH)) is None:
        return absent("1", title, TOUCH)
    skin = skin_maps.read(skin_of(run, TOUCH, result))
    plate = skin_maps.equipotentials(skin, result["scene"], skin_maps.apart(skin.patterns))
    signal, baseline = _signal(result)
    share = float(np.sqrt(np.nanmean(signal**2) / np.nanmean(baseline**2)))
    numbers = (Number("RMS of the signal over that of the untouched voltages", "%", 100 * share),)
    return Section("1", title, "An object of another conductivity bends the lines of two injection patterns; a sketch "
                   "without numbers.",
                   "Lines of the touch of figure 10, computed. The change of the potential is drawn next to both.",
                   f"The paper's object bends the lines visibly; a real touch does not: it changes the voltages by "
                   f"{percent(share)} of their RMS, so that only the change itself shows it.", (TOUCH,),
                   (renamed(plate, "figure_1"),), numbers)


def _signal(result: Mapping[str, Any]) -> tuple[reading_figures.Array, reading_figures.Array]:
    touched, baseline = (np.array(result[key], dtype=float) for key in ("readings_V", "baseline_V"))
    return touched - baseline, baseline


def meshes(run: Run) -> Section:
    """Figure 7: the sensor's mesh, electrodes and two random scenes."""
    title = "mesh, electrodes and two random scenes"
    found = {name: result for name in (TOUCH, FIRST, SECOND) if (result := result_of(run, name)) is not None}
    if len(found) < 3:
        return absent("7", title, TOUCH, FIRST, SECOND)
    sensors = [paper_meshes.meshed(result["scene"], skin_of(run, name, result)) for name, result in found.items()]
    scene = found[TOUCH]["scene"]
    numbers = (Number("electrodes", "–", scene["electrodes"]["count"]),
               Number("radius of the disc", "mm", scene["body"]["radius_mm"]),
               Number("thickness of the foam", "mm", scene["body"]["thickness_mm"]),
               Number("elements of the skin", "–", sensors[0].elements))
    return Section("7", title, "A disc of 200 mm by 10 mm with 16 electrodes, all hexahedra, skin included; the punch "
                   "takes any place, 10 to 18 mm and 0.1 to 2 N.",
                   "Electrodes are lines of 10 mm on the rim with a contact impedance, for the paper gives neither; "
                   "copper does not stiffen the rim; the punch is rigid, frictionless, with a fillet of 0.5 mm, for a "
                   "sharp edge has no finite peak pressure.",
                   "The skin is a sheet meshed anew about every touch, not a layer of solids; foam far from the rim is "
                   "solved in a half-plane, near it in three dimensions.", (TOUCH, FIRST, SECOND),
                   (paper_meshes.meshes("figure_7", sensors),), numbers)


def convergence(run: Run) -> Section:
    """Figure 8: convergence of mean contact stress and depth."""
    title = "mesh convergence of mean contact stress and depth"
    path = run.stages[CONVERGENCE].folder / "convergence.csv"
    if not path.is_file():
        return absent("8", title, CONVERGENCE)
    table = pd.read_csv(path)
    found = paper_meshes.courses(table)
    numbers = []
    for (column, order), own in found.items():
        words = f"{paper_meshes.COURSES[column][0]}, {paper_meshes.ORDERS[order]} elements"
        if own.observed is not None:
            numbers.append(Number(f"observed order of the {words}", "–", own.observed))
    default = table[table["size_over_default"] == 1.0]
    if len(default):
        chosen = default.iloc[-1]
        finest = found["delta_max_mm", int(chosen["order"])].value[-1]
        numbers += [Number("elements chosen", "–", float(chosen["elements"])),
                    Number("depth there against the finest mesh", "%",
                           100 * abs(float(chosen["delta_max_mm"]) / float(finest) - 1))]
    return Section("8", title, "Curves over the number of elements that flatten; 63,000 linear hexahedra are taken.",
                   "The touch of figure 10, frictionless, with a filleted punch, for a sharp edge has no finite "
                   "peak stress. Elements halve everywhere at once.",
                   _convergence_differs(numbers), (CONVERGENCE,), (paper_meshes.convergence("figure_8", table),),
                   tuple(numbers))


def _convergence_differs(numbers: list[Number]) -> str:
    known = {n.quantity: n.value for n in numbers}
    if (elements := known.get("elements chosen")) is None:
        return "The table holds no mesh of the default size."
    return (f"The paper's curves carry no error. Here {elements:.0f} quadratic elements of a "
            f"half-plane leave {number(known['depth there against the finest mesh'], 2)} % in the depth; the counts "
            "cannot be compared, for the paper's mesh fills the disc in three dimensions.")


def holds(run: Run) -> Section:
    """Figure 9: relaxation of contact pressure and of one potential under both kinds of hold."""
    title = "a held touch over 180 s"
    found = {kept: result for kept, name in HOLDS.items() if (result := result_of(run, name)) is not None}
    if len(found) < len(HOLDS):
        return absent("9", title, *HOLDS.values())
    numbers = []
    for kept, result in found.items():
        rows, reading = touches.course(result), touches.followed(found["force"])
        numbers += [Number(f"mean pressure lost in {t:g} s, hold at {kept}", "%",
                           -touches.changed(rows, "sigma_ave_kPa", t)) for t in (WITHIN_S, LAST_S)]
        moved = {"voltage": reading} | ({"depth": "delta_max_mm"} if kept == "force" else {})
        numbers += [Number(f"change of the {words} in {LAST_S:g} s, hold at {kept}", "%",
                           touches.changed(rows, column, LAST_S)) for words, column in moved.items()]
    slow = next(kept for kept in found if kept not in ("force", "depth"))
    loading_s = found[slow]["scene"]["hold"]["loading_s"]
    numbers.append(Number("loading time of the slow loading, found", "s", loading_s))
    lost, lost_slow = (value_of(numbers, LOST.format(kept)) for kept in ("depth", slow))
    later, later_slow = (value_of(numbers, f"mean pressure lost in {LAST_S:g} s, hold at {kept}")
                         for kept in ("depth", slow))
    paper = paper_value("9", LOST.format("depth"))
    return Section("9", title, "The mean contact pressure drops by 10 % within 2 s, after that neither it nor the "
                   "potential changes by much; viscoelasticity is left out from there on.",
                   "The paper says neither what is held nor how fast it is loaded, and under a force that is kept F/A "
                   "cannot relax: both holds are shown, loaded at once, and a kept depth that is loaded at a constant "
                   f"rate of force in {number(loading_s)} s, the time that a search finds for the paper's "
                   f"{number(paper, 2)} %. A depth that is kept from loading at once leaves all strains, so the "
                   "voltages, as they were.",
                   f"At a depth kept from loading at once {number(lost)} % are lost in 2 s, {against(lost, paper)}, "
                   f"and {number(later)} % in 180 s: so says the paper's own Table 1 of any foam with β = 0. Loaded in "
                   f"{number(loading_s)} s, {number(lost_slow)} % are lost in 2 s: one time found for one number, so "
                   f"that only what follows tests it, and {number(later_slow)} % in 180 s are not the little change "
                   "that the paper has. Under a kept force the mean pressure stays and the punch sinks "
                   f"{number(value_of(numbers, f'change of the depth in {LAST_S:g} s, hold at force'))} % deeper.",
                   (*HOLDS.values(), LOADING), (touches.holds("figure_9", found, 1 - paper / 100),), tuple(numbers))


def touched(run: Run) -> list[Section]:
    """Figures 10 and 11: the readings and the maps of one touch."""
    titles = ("voltages of one touch over the full cycle", "pressure, strain and displacement of that touch")
    if (result := result_of(run, TOUCH)) is None:
        return [absent("10", titles[0], TOUCH), absent("11", titles[1], TOUCH)]
    signal, baseline = _signal(result)
    factor, unit = volts(signal)
    numbers = (Number("readings of one touch", "–", signal.size), Number("drive patterns", "–", len(signal)),
               Number("drive current", "mA", result["scene"]["drive"]["current_mA"]),
               Number("RMS of the untouched voltages", "V", float(np.sqrt(np.nanmean(baseline**2)))),
               Number("RMS of the signal", "mV", 1e3 * float(np.sqrt(np.nanmean(signal**2)))),
               Number("force", "N", result["force_N"]), Number("depth", "mm", result["delta_max_mm"]),
               Number("peak contact pressure", "kPa", result["sigma_max_kPa"]),
               Number("mean contact pressure", "kPa", result["sigma_ave_kPa"]),
               Number("contact area", "mm²", result["A_c_mm2"]))
    curve = Section("10", titles[0], "Potentials of 16 patterns after one touch, whose place, size and four mechanical "
                    "outputs stand in the figure; its values are not in the text.",
                    "The touch of examples/scene.toml: 14 mm, 1 N. Electrodes carry 5 mA; the contact impedance "
                    "(1 Ω m) is ours.",
                    f"The touch lies within the line's width: its largest signal is "
                    f"{number(np.nanmax(np.abs(signal)) * factor)} {unit}, so it is drawn separately.", (TOUCH,),
                    (renamed(reading_figures.curves(signal + baseline, baseline), "figure_10"),), numbers)
    return [curve, _maps(run, result, titles[1])]


def _maps(run: Run, result: Mapping[str, Any], title: str) -> Section:
    skin, (punch,) = skin_maps.read(skin_of(run, TOUCH, result)), result["scene"]["punch"]
    place = {name: _radius(skin, values, punch) for name, values in (
        ("largest pressure", skin.fields["contact_pressure_Pa"]),
        ("largest in-plane strain", skin.fields["largest_in_plane_strain"]),
        ("largest displacement", -skin.fields["displacement_m"][:, 2]))}
    numbers = (*(Number(f"distance of the {name} from the axis", "mm", r) for name, r in place.items()),
               Number("largest in-plane principal strain", "–", float(skin.fields["largest_in_plane_strain"].max())))
    radius = punch["diameter_mm"] / 2
    return Section("11", title, "Strain is largest at the outer boundary of the punch, displacement at its centre, "
                   "and the pressure is highest where the strain is greatest.",
                   "Peak pressure is an average over a facet of the mesh, for a fillet of 0.5 mm. The displacement is "
                   "the same over the flat face, so its largest value lies anywhere on it.",
                   f"With the punch's edge at {number(radius)} mm, pressure peaks at "
                   f"{number(place['largest pressure'])} mm and strain at "
                   f"{number(place['largest in-plane strain'])} mm: {_at_edge(place, radius)}.", (TOUCH,),
                   (renamed(skin_maps.response(skin, result["scene"]), "figure_11"),), numbers)


def _at_edge(place: Mapping[str, float], radius: float) -> str:
    """Whether pressure and strain are largest within a fifth of the radius of the punch's edge, in words."""
    off = [name for name in ("largest pressure", "largest in-plane strain") if abs(place[name] / radius - 1) > 0.2]
    if off:
        return f"unlike the paper's, not at the edge: {', '.join(off)}"
    return "both at the edge, as the paper says"


def _radius(skin: skin_maps.SkinMap, values: reading_figures.Array, punch: Mapping[str, Any]) -> float:
    k = int(np.argmax(values))
    return float(np.hypot(skin.triangles.x[k] - punch["x_mm"], skin.triangles.y[k] - punch["y_mm"]))
