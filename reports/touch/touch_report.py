"""The report of one touch, from the `result.json` of `eitsim run`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.simulation.result_json import ERRORS, MECHANICS
from reports.document import provenance
from reports.document.numerals import counted, interval, number, percent, typeset, volts
from reports.document.page import Report, ReportFigure, Table
from reports.document.verdict import ERROR, EXTRAPOLATED, NOT_USABLE, PAST_TEST, Verdict, graded, no_better, real, worst
from reports.touch import body_picture, layer_figure, reading_figures, skin_maps, touch_figures
from reports.touch.drive_sentence import drive_sentence
from touchcal.document import Keys
from touchcal.errors import InputFileError
from touchcal.json_file import read_json

TOGETHER = {"general", "on_surface"}  # Kinds of routes whose profiles are means over the directions about a punch.
# Kinds of decisions, those of all routes but the axisymmetric one, by which edges or a neighbour change the touch.
CHANGED = {"nearest_edge", "all_edges", "whole_disc", "pair", *TOGETHER}
RUN_AGAIN = "Run `eitsim run` again with --skin."
NO_MAPS = ("No maps of the skin: the result names no file of them. `eitsim run --skin skin.vtu --out result.json` "
           "writes one.")
NO_SHEET = "No maps of a skin: the layer conducts in its volume. The current through it is drawn above."
LAYER = "The punch is rigid and pressed into a layer that conducts in its volume, read by electrodes. "
ON_PLATE = "It is bonded to a rigid plate."
ON_BASE = "It is bonded to a soft base, which does not conduct, and that to a rigid plate."
NO_VOLTAGES = "No voltages: the result holds no readings, since its outcome is \"{outcome}\"."


def report(path: Path) -> Report:
    """Everything that the template `touch.typ` shows of a result; InputFileError where the file is none."""
    result = read_result(path)
    absent: dict[str, str] = {}
    plates = _plates(path, result, absent) + _maps(path, result, absent)
    tables = {"plan": _plan_table(result["plan"])}
    prose = provenance.origin(result)
    if "delta_max_mm" in result:
        tables["mechanics"] = _mechanics_table(result)
    else:
        absent["mechanics"] = f"No mechanical outputs: the outcome is \"{result['outcome']}\"."
    if times := result.get("times", []):
        tables["hold"] = _hold_table(times, _voltages(result)[1])
    if "scene" in result:
        tables["scene"] = _scene_table(result["scene"])
        prose["drive"] = drive_sentence(result["scene"]["drive"])
        if _layered(result):
            prose["layer"] = LAYER + (ON_BASE if "base_card" in result["scene"]["skin"] else ON_PLATE)
    else:
        absent["scene"] = "The result does not hold its scene."
    tables["quality"] = _quality_table(result)
    files = [file for file in (path, _skin_file(path, result)) if file is not None and file.is_file()]
    footer = provenance.footer([provenance.source(file) for file in files], "no seed: nothing is drawn")
    card = f"Card {provenance.card_words(result['card'])}, " if result.get("card") else ""
    return Report("touch", "Touch simulation", f"{card}outcome: {result['outcome']}", footer, _findings(result), plates,
                  tables, absent, prose, verdict=_verdict(result), cautions=_cautions(result))


def _layered(result: Mapping[str, Any]) -> bool:
    """Whether the skin of a result conducts in its volume."""
    return result.get("scene", {}).get("skin", {}).get("kind") == "layer"


def read_result(path: Path) -> dict[str, Any]:
    """A result as its JSON object; InputFileError where it is not one."""
    return read_json(path, "a result of `eitsim run`", "Give the file that `eitsim run --out` wrote, or the folder "
                     "of a sweep.", Keys({"outcome": str, "plan": [dict], "cost": dict}))


def touches(result: Mapping[str, Any], key: str) -> list[float]:
    """The values of a mechanical output, one a touch."""
    value = result[key]
    return list(value) if isinstance(value, list) else [value]


def _verdict(result: Mapping[str, Any]) -> list[Verdict]:
    """What depth, pressure, the signal, and the signal of a real skin are good for."""
    if result["outcome"] != "ok":
        return [Verdict("This touch", NOT_USABLE, f"its outcome is {result['outcome']}")]
    error, stability = result.get("error_estimate", {}), result.get("stability", {})
    mechanical = {ERRORS[key]: error[key] for key in ("depth", "A_c") if key in error}
    grades = [graded(value, ERROR) for value in mechanical.values()]
    why = [f"{name} to {percent(value)}" for name, value in mechanical.items()]
    if not stability.get("elliptic", True):
        grades.append(NOT_USABLE)
        why.append(f"strong ellipticity is lost at {percent(stability['fraction_non_elliptic'])} of the points")
    fitted = stability.get("fitted_law_strain") or stability.get("fitted_foam_strain")  # the latter in older results
    if fitted and (past := fitted[0] - stability["least_strain"]) > 0:
        grades.append(graded(past, PAST_TEST))
        least, law = number(stability["least_strain"]), stability.get("law", "foam")
        why.append(f"{law} strained to {least}, tested to {number(fitted[0])}")
    found = [Verdict("Depth and contact area", worst(*grades), ", ".join(why))] if grades else []
    if "sigma_max" in error:
        pressure = Verdict("Largest pressure", graded(error["sigma_max"], ERROR), f"to {percent(error['sigma_max'])}")
        found.append(no_better(pressure, found[0]) if found else pressure)
    by_law = [Verdict("Signal by the card's law", graded(error["signal"], ERROR),
                      f"to {percent(error['signal'])}, estimated")] if "signal" in error else []
    found += by_law
    if (share := stability.get("signal_share_extrapolated")) is not None:
        ends = stability.get("fitted_skin_strain")
        why = [f"{percent(share)} of it comes from extrapolated conductivity"]
        why += [f"measured for strains of {interval(*ends)}"] if ends and share else []
        of_skin = Verdict("Signal of a real skin", graded(share, EXTRAPOLATED), ", ".join(why))
        found.append(no_better(of_skin, by_law[0]) if by_law else of_skin)
    return found + real("A real sensor", (result.get("card") or {}).get("synthetic", False))


def _cautions(result: Mapping[str, Any]) -> list[str]:
    """What the run itself says, and decisions whose cost is in no error estimate."""
    said = [result["message"]] if result["outcome"] == "ok" and result.get("message") else []
    unknown = [d["decision"] for d in result["plan"] if d.get("unbounded")]
    said += [f"At a cost that is unknown and in no error: {'; '.join(unknown)}."] if unknown else []
    return [*map(typeset, said)]


def _findings(result: Mapping[str, Any]) -> list[str]:
    found = [] if result["outcome"] == "ok" else [f"Outcome {result['outcome']}: {result.get('message', '')}".strip()]
    if "delta_max_mm" in result:
        depths, forces = touches(result, "delta_max_mm"), touches(result, "force_N")
        peaks = touches(result, "sigma_max_kPa")
        names = ["the punch"] if len(depths) == 1 else [f"punch {i}" for i in range(1, len(depths) + 1)]
        at = f"{when.capitalize()}, " if (when := _when(result)) else ""
        found += [f"{at}{number(force)} N presses {name} {number(depth)} mm deep; the peak contact pressure is "
                  f"{number(peak)} kPa." for name, force, depth, peak in zip(names, forces, depths, peaks, strict=True)]
    if "readings_V" in result:
        touched, baseline = _voltages(result)
        lost = int(np.isnan(touched).sum())
        without = f" ({lost} more need a missing electrode)" if lost else ""
        size = reading_figures.size_words(touched - baseline, baseline)
        found.append(f"Of {touched.size - lost} readings{without}: {size}.")
    if "error_estimate" in result:
        error = result["error_estimate"]
        found.append(f"Estimated relative error: {percent(error['signal'])} of the signal, {percent(error['depth'])} "
                     f"of the depth; cost {number(result['cost']['cpu_s'])} s of CPU.")
    return found


def _voltages(result: Mapping[str, Any]) -> tuple[reading_figures.Array, reading_figures.Array]:
    return np.array(result["readings_V"], dtype=float), np.array(result["baseline_V"], dtype=float)


def _plates(path: Path, result: Mapping[str, Any], absent: dict[str, str]) -> list[ReportFigure]:
    plates = []
    if "scene" in result:
        plates += _scene(path, result, absent)
    if profiles := result.get("profile", []):
        # where the rim or a neighbour changes the surface outside the profile, that is of the touch alone
        kinds = {decision.get("kind") for decision in result["plan"]}
        plates += [touch_figures.profile(block, i, len(profiles), not CHANGED.isdisjoint(kinds),
                                         not TOGETHER.isdisjoint(kinds))
                   for i, block in enumerate(profiles)]
        plates += [layer_figure.layer(block, profile, result["scene"]["skin"]["thickness_mm"], i, len(profiles))
                   for i, (block, profile) in enumerate(zip(result.get("layer", []), profiles, strict=False))]
    else:
        absent["profile"] = "No surface profile: the result holds none."
    if "readings_V" in result:
        touched, baseline = _voltages(result)
        plates += [reading_figures.curves(touched, baseline), reading_figures.signal_map(touched, baseline)]
    else:
        absent["readings"] = NO_VOLTAGES.format(outcome=result["outcome"])
    return plates


def _scene(path: Path, result: Mapping[str, Any], absent: dict[str, str]) -> list[ReportFigure]:
    """The sensor; a curved body whose surface is a file where that lies next to the result."""
    if not _curved(result):
        return [touch_figures.scene(result["scene"])]
    try:
        return [body_picture.body(result["scene"], path.parent)]
    except InputFileError:
        absent["scene"] = f"No picture of the body: {result['scene']['body']['surface']} is not next to the result."
        return []


def _maps(path: Path, result: Mapping[str, Any], absent: dict[str, str]) -> list[ReportFigure]:
    """Maps of the skin where the result names the file that holds them; else `absent` says why there are none."""
    file = _skin_file(path, result)
    if file is None or "scene" not in result:
        absent["maps"] = NO_SHEET if _layered(result) else NO_MAPS
        return []
    if not file.is_file():
        absent["maps"] = f"No maps: {file.name}, which the result names, is not next to it."
        return []
    if provenance.source(file).sha256 != result["skin_file"]["sha256"]:
        absent["maps"] = f"No maps: {file.name} is not the file that was written with this result. {RUN_AGAIN}"
        return []
    if _curved(result):
        if "scene" in absent:
            absent["maps"] = absent["scene"]
            return []
        return [body_picture.response(file, result["scene"])]
    skin = skin_maps.read(file)
    return [skin_maps.response(skin, result["scene"]),
            skin_maps.equipotentials(skin, result["scene"], skin_maps.apart(skin.patterns))]


def _curved(result: Mapping[str, Any]) -> bool:
    return "surface" in result["scene"]["body"]


def _skin_file(path: Path, result: Mapping[str, Any]) -> Path | None:
    """The file of `eitsim run --skin` that the result names, next to it."""
    return path.parent / result["skin_file"]["name"] if "skin_file" in result else None


def _mechanics_table(result: Mapping[str, Any]) -> Table:
    columns = {key: touches(result, key) for key in MECHANICS if key in result}
    count = len(next(iter(columns.values())))
    rows = [[MECHANICS[key][0], MECHANICS[key][1], *(number(v) for v in values)] for key, values in columns.items()]
    heads = ["value"] if count == 1 else [f"touch {i + 1}" for i in range(count)]
    at = f" {when}" if (when := _when(result)) else ""
    caption = f"The mechanical outputs{at}{_peaks(columns['sigma_max_kPa'], columns['sigma_ave_kPa'])}."
    if flat := result.get("as_if_flat"):
        rows = [[*row, *(number(v) for v in touches(flat, key))] for row, key in zip(rows, columns, strict=True)]
        heads += ["as if flat"] if count == 1 else [f"{i + 1} as if flat" for i in range(count)]
        caption += (" As if flat: what the same punch gives alone, upright and without friction on a flat layer of the "
                    "same thickness.")
    return Table(caption, ["output", "unit", *heads], rows, "wl" + "r" * len(heads))


def _peaks(peaks: Sequence[float], means: Sequence[float]) -> str:
    """What the peak pressures are of the means, one a touch; said once where all touches have the same."""
    ratios = [(i, number(peak / mean)) for i, (peak, mean) in enumerate(zip(peaks, means, strict=True), 1) if mean]
    if not ratios:
        return ""
    if len({ratio for _, ratio in ratios}) > 1:
        return f"; the peak pressure is {', '.join(f'{ratio} (touch {i})' for i, ratio in ratios)} times the mean"
    return f"; the peak pressure is {ratios[0][1]} times the mean" + (" in each touch" if len(ratios) > 1 else "")


def _when(result: Mapping[str, Any]) -> str:
    """The time that the results of a hold stand for, its last, in words; empty without a hold."""
    times = result.get("times", [])
    if not times:
        return ""
    last = times[-1]["time_s"]
    return f"after {number(last)} s" if last > 0 else "at the end of loading"


def _hold_table(times: Sequence[Mapping[str, Any]], baseline_V: reading_figures.Array) -> Table:
    """Force, depth, peak pressure and largest signal of a hold, a row a time, values of several touches one after
    another; `times` of a result, baseline in V."""
    signals = [float(np.nanmax(np.abs(np.array(block["readings_V"], dtype=float) - baseline_V))) for block in times]
    factor, unit = volts(signals)
    keys = ("force_N", "delta_max_mm", "sigma_max_kPa")
    rows = [[number(block["time_s"]), *(_each(block, key) for key in keys), number(signal * factor)]
            for block, signal in zip(times, signals, strict=True)]
    first, last = times[0], times[-1]
    caption = "The hold, timed from the end of loading"
    if len(times) > 1:
        changes = [_change(name, _each(first, key), _each(last, key), unit_of) for name, key, unit_of in
                   (("force", "force_N", "N"), ("depth", "delta_max_mm", "mm"))]
        caption += f": {' and '.join(changes)}"
    caption += f". The other results in this report are those {_when({'times': times})}."
    return Table(caption, ["time (s)", "force (N)", "depth (mm)", "peak pressure, facet average (kPa)",
                           f"largest signal ({unit})"], rows, "rrrrr")


def _each(block: Mapping[str, Any], key: str) -> str:
    return ", ".join(number(value) for value in touches(block, key))


def _change(name: str, start: str, end: str, unit: str) -> str:
    return f"the {name} stays at {end} {unit}" if start == end else f"the {name} goes from {start} to {end} {unit}"


def _cost(bound: float) -> str:
    """A bound as per cent; below a hundredth of one that alone."""
    return "–" if not bound else "< 0.01 %" if bound < 1e-4 else percent(bound)


def _plan_table(plan: Sequence[Mapping[str, Any]]) -> Table:
    rows = [[typeset(d["decision"]), typeset(d["reason"]), _cost(d["error_bound"])] for d in plan]
    total = sum(d["error_bound"] for d in plan)
    largest = max(plan, key=lambda d: d["error_bound"], default=None)
    caption = (f"What the plan decided: {counted(len(plan), 'decision')} that may together cost {percent(total)} of "
               "the signal")
    if largest is not None and largest["error_bound"] > 0:
        caption += f", most of it by “{typeset(largest['decision'])}”"
    return Table(caption + ". A dash: no cost is counted.", ["decision", "reason", "may cost"], rows, "wWr")


def _scene_table(scene: Mapping[str, Any]) -> Table:
    rows = []
    for table, value in scene.items():
        for i, block in enumerate(value if isinstance(value, list) else [value]):
            name = f"{table} {i + 1}" if isinstance(value, list) and len(value) > 1 else table
            idle = {"half_angle_deg"} if table == "punch" and block.get("profile") != "cone" else set[str]()
            rows.append([name, ", ".join(f"{key} = {_cell(v)}" for key, v in block.items() if key not in idle)])
    return Table(f"The scene in full, defaults filled in: {counted(len(rows), 'table')} with units in their keys.",
                 ["table", "keys"], rows, "lw")


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_cell(v) for v in value) + "]"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value).lower() if isinstance(value, bool) else str(value)
    return f"{value:.10g}"


def _quality_table(result: Mapping[str, Any]) -> Table:
    rows = [[f"estimated relative error of the {ERRORS.get(key, key)}", percent(value)]
            for key, value in result.get("error_estimate", {}).items()]
    rows += [[f"most that its neighbours change of a touch, {key}", percent(value)]
             for key, value in result.get("interaction", {}).items()]
    stability = result.get("stability", {})
    if "fraction_non_elliptic" in stability:
        rows.append(["quadrature points where strong ellipticity is lost", percent(stability["fraction_non_elliptic"])])
    if "skin_fraction_extrapolated" in stability:
        rows.append(["skin area strained outside the fitted range of the conductivity",
                     percent(stability["skin_fraction_extrapolated"])])
    if "signal_share_extrapolated" in stability:
        rows.append(["signal from there: rings' shares of the dipole moment in a uniform field",
                     percent(stability["signal_share_extrapolated"])])
    if past := stability.get("signal_past_law"):
        rows.append(["signal left open where the conductivity's law is not positive, in its error", percent(past)])
    names = {"cpu_s": ("CPU time", "s"), "wall_s": ("wall time", "s"), "peak_MB": ("peak memory of the process", "MB")}
    cost = result["cost"]
    rows += [[name, f"{number(cost[key])} {unit}"] for key, (name, unit) in names.items() if key in cost]
    return Table(_quality_caption(stability), ["quantity", "value"], rows, "wr")


def _quality_caption(stability: Mapping[str, Any]) -> str:
    if "elliptic" not in stability:
        return "Error, stability and cost, as far as the run reached."
    held = ("Strong ellipticity holds everywhere" if stability["elliptic"] else
            f"Strong ellipticity is lost at {percent(stability['fraction_non_elliptic'])} of the quadrature points")
    outside, share = stability.get("skin_fraction_extrapolated", 0.0), stability.get("signal_share_extrapolated")
    if not outside:
        return held + "; the whole skin stays in the range of the conductivity fit."
    most = "" if share is None else f", and {percent(share)} of the signal comes from there"
    return held + (f"; {percent(outside)} of the skin is strained outside the range in which the conductivity was "
                   f"measured{most}.")
