"""What the terminal shows of plans, results, models and images: tables for people, the files that were written."""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from eitsim.scene.results import Decision, Plan, Result
from eitsim.simulation.result_json import ERRORS, MECHANICS
from touchcal.number_words import counted

if TYPE_CHECKING:
    from eitsim.sensors.inspection import Inspection
    from eitsim.sensors.layout.sensor_design import SensorDesign

_FLAT = ("force_N", "delta_max_mm", "A_c_mm2")  # Outputs that are compared with those of a flat layer.
_MOST_NUMBERS = 4  # of parameters that are named one by one
_MOST_IMAGES, _MOST_NOTES = 16, 8  # one a line


def show_plan(made: Plan, *, reasons: bool = True) -> None:
    """Every decision of a plan, what it may cost of the signal, and why."""
    table = Table("may cost", "decision", *(["reason"] if reasons else []), box=box.SIMPLE_HEAD, title_justify="left",
                  title="plan: each choice, and what it may cost of the signal (readings touched less untouched)")
    for d in made.decisions:
        of = "" if d.touch is None else f"touch {d.touch}: "
        table.add_row(_cost(d), escape(of + d.decision), *([escape(d.reason)] if reasons else []))
    table.add_section()
    table.add_row(_percent(made.error_bound), "all known costs together")
    _console().print(table)
    if not reasons:
        print("with --verbose: the reason of each choice")


def _cost(d: Decision) -> str:
    return _percent(d.error_bound) if d.error_bound else "unknown" if d.unbounded else "-"


def _percent(share: float) -> str:
    return f"{share:.2%}" if share >= 5e-5 or not share else "<0.01%"


def _plan_in_a_line(made: Plan, scene: Path) -> str:
    largest = max(made.decisions, key=lambda d: d.error_bound)
    unknown = dict.fromkeys(d.decision for d in made.decisions if d.unbounded)
    return (f"plan: what is left out may cost {_percent(made.error_bound)} of the signal, most of it by "
            f"\"{largest.decision}\". Not in any error, since the cost is unknown: "
            f"{'; '.join(unknown) or 'nothing'}. `eitsim plan {scene} --verbose` lists all with their reasons.")


def _console() -> Console:
    """The terminal as it is, or COLUMNS wide; a pipe takes 120 columns."""
    console = Console()
    return console if console.is_terminal or "COLUMNS" in os.environ else Console(width=120)


def show_result(result: Result, document: dict[str, Any], scene: Path) -> None:
    if result.readings is None:
        show_plan(result.plan)
    else:
        largest_V = max(abs(value) for value in result.readings.signal_V.flat if value == value)
        table = Table("quantity", "value", title=f"touch: {result.outcome}", title_justify="left", box=box.SIMPLE_HEAD)
        for key, (name, _) in MECHANICS.items():
            values = document[key] if isinstance(document[key], list) else [document[key]]
            table.add_row(f"{name}, {key}", ", ".join(f"{value:.5g}" for value in values))
            if "as_if_flat" in document and key in _FLAT:
                flat = ", ".join(f"{value:.5g}" for value in _listed(document["as_if_flat"][key]))
                table.add_row("  as if flat: alone, upright, without friction", flat)
        table.add_row("Largest signal, voltage touched less untouched, mV", f"{largest_V * 1e3:.4g}")
        for key, value in result.error_estimate.items():
            numerical = result.numerical_error[key]
            table.add_row(f"Error of {ERRORS.get(key, key)}", f"{value:.2%}, numerical {numerical:.2%}")
        for key, value in result.interaction.items():
            table.add_row(f"Of it at most by neighbours, {ERRORS.get(key, key)}", f"{value:.2%}")
        _add_ranges(table, document["stability"])
        table.add_row("CPU, s", f"{result.cost['cpu_s']:.2f}")
        if result.cost["compilation_cpu_s"]:
            table.add_row("CPU of compiling, once, s", f"{result.cost['compilation_cpu_s']:.2f}")
        _console().print(table)
        print(_plan_in_a_line(result.plan, scene))
        if result.outcome == "ok" and result.message:
            print(f"note: {result.message}")
    if result.moments:
        keys = ("time_s", "delta_max_mm", "force_N", "sigma_ave_kPa", "sigma_max_kPa", "A_c_mm2")
        table = Table(*keys, title="hold, from the end of loading")
        for block in document["times"]:
            table.add_row(*(", ".join(f"{value:.5g}" for value in _listed(block[key])) for key in keys))
        _console().print(table)


def _listed(value: float | list[float]) -> list[float]:
    return value if isinstance(value, list) else [value]


def show_solved(document: dict[str, Any], out: Path | None) -> None:
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
    _console().print(table)
    if out is not None:
        print(f"result: {out}")


def show_images(document: dict[str, Any], out: Path | None) -> None:
    keys = ("line", "x_mm", "y_mm", "area_mm2", "peak")
    table = Table(*keys, title="images: quarter-amplitude area, its centre, largest relative change of conductance")
    for image in document["frames"][:_MOST_IMAGES]:
        table.add_row(*("-" if image[key] is None else f"{image[key]:.4g}" for key in keys))
    _console().print(table)
    noted = [image for image in document["frames"] if "note" in image]
    for image in noted[:_MOST_NOTES]:
        print(f"line {image['line']}: {image['note']}")
    hidden, unsaid = (max(len(of) - most, 0) for of, most in ((document["frames"], _MOST_IMAGES), (noted, _MOST_NOTES)))
    if hidden or unsaid:
        print(f"{counted(hidden, 'more line')} and {counted(unsaid, 'more note')}: --json holds all.")
    untouched = "" if document["misfit"] is None else (
        f"untouched: {document['conductance_S']:.4g} S a square, misfit {document['misfit']:.2%}; ")
    print(f"{untouched}{document['differences']} differences, prior {document['prior']}, noise figure "
          f"{document['noise_figure']:.3g}")
    if document["cautions"]:
        print("Mind:", *(f"- {caution}" for caution in document["cautions"]), sep="\n")
    if out is not None:
        print(f"images: {out}")


def _add_ranges(table: Table, stability: dict[str, Any]) -> None:
    """Rows that set the least strain against the fitted ones of the law, and what the skin's law extrapolates."""
    table.add_row("Least strain of the surface", f"{stability['least_strain']:.3f}")
    for place in filter(None, stability["non_elliptic_mm"]):
        depths, share = " to ".join(f"{each:.3g}" for each in place["below_mm"]), stability["fraction_non_elliptic"]
        table.add_row("Strong ellipticity lost, mm below the skin", f"{depths}; {share:.1%} of the points")
    for part, name in (("law", stability["law"]), ("skin", "Skin law")):
        fitted = stability[f"fitted_{part}_strain"]
        words = "not stated by the card"
        if fitted is not None:
            words = " to ".join(f"{round(end, 3) + 0.0:g}" for end in fitted)
            words += ", extrapolated" if part == "law" and stability["least_strain"] < fitted[0] else ""
        table.add_row(f"{name} fitted over strains", words)
    share = stability.get("signal_share_extrapolated")
    table.add_row("Skin outside its fit", f"{stability['skin_fraction_extrapolated']:.2%} of it"
                  + ("" if share is None else f", {share:.0%} of the signal"))
    if past := stability.get("signal_past_law"):
        table.add_row("Left open where its law is not positive", f"{past:.2%} of the signal, in its error")


def show_inspection(found: Inspection) -> None:
    """What the readings say, what to mind, and what they leave to the user."""
    from eitsim.sensors.inspection_words import cautions, questions, rows

    table = Table("", "", title=f"{found.recording.source}: what the readings say", title_justify="left",
                  box=box.SIMPLE_HEAD, show_header=False)
    for name, words in rows(found):
        table.add_row(name, escape(words))
    console = _console()
    console.print(table)
    for title, lines in (("Mind", cautions(found)), ("To answer", questions(found))):
        for k, line in enumerate(lines):
            console.print(f"{title}:" if k == 0 else "", f"- {line}", sep="\n" if k == 0 else "", markup=False,
                          highlight=False)


def show_calibration(document: dict[str, Any], out: Path) -> None:
    """What a calibration gave: each stage on drives that were fitted and not, each group's spread, what is not said."""
    if document["unexplained"]:
        table = Table("freed", "fitted drives", "other drives", "", box=box.SIMPLE_HEAD, title_justify="left",
                      title="readings off the driven electrodes that stay unexplained, half of the drives fitted")
        for group, left in document["unexplained"].items():
            table.add_row(group, _percent(left["fitted"]), _percent(left["held_out"]),
                          "kept" if group in document["kept"] else "freed in the last fit alone")
        _console().print(table)
    groups: dict[str, list[dict[str, float]]] = {}
    for name, one in document["parameters"].items():
        groups.setdefault(_group(name), []).append(one)
    if groups:
        table = Table("parameter", "values", "sd, largest", "prior sd", box=box.SIMPLE_HEAD, title_justify="left",
                      title="parameters, their standard deviation after and before the fit")
        for name, each in groups.items():
            ends = [f"{pick(one['value'] for one in each):.4g}" for pick in (min, max)]
            table.add_row(name, " to ".join(dict.fromkeys(ends)), f"{max(one['sd'] for one in each):.2g}",
                          f"{max(one['prior_sd'] for one in each):.2g}")
        _console().print(table)
    if document["absolute_model"] == "usable":
        one = document["parameters"]["ln_conductance_S"]
        print(f"sheet conductance: {1e3 * math.exp(one['value']):.4g} mS +- {_percent(one['sd'])}")
        if (layer := document["layer"]) is not None:
            print(f"layer: conducts {layer['conductivity_S_per_m']:.4g} S/m where it is {layer['thickness_mm']:.4g} mm "
                  "thick; only the product of both shows in untouched readings")
    for electrode, why in document["left_out"].items():
        print(f"electrode {electrode} is left out: {why}")
    if (presses := document["presses"]) is not None:
        one, left = document["parameters"]["ln_moment_mm2"], presses["unexplained"]
        x, y = presses["centre_mm"]
        middle = "centre" if "outline" not in document["sensor"]["body"] else "origin"
        print(f"the sensor's {middle} lies at {x:.4g}, {y:.4g} mm in the labels, which are turned by "
              f"{presses['turn_deg']:.3g} deg" + (" and mirrored" if presses["mirrored"] else ""))
        print(f"{presses['count']} labelled presses: ln of the moment in mm2 {one['value']:.3g} +- {one['sd']:.2g}; "
              f"{_percent(left['size']['held_out'])} of presses that were not fitted stay unexplained"
              + (f", with a gain for each reading {_percent(left['gains']['held_out'])}"
                 if document["absolute_model"] != "usable" else ""))
    if (skin := document["skin"]) is not None:
        left = skin["unexplained"]
        print(f"skin of {skin['count']} presses: {', '.join(skin['kept']) or 'no group'} kept; "
              f"{_percent(left['card'])} of the signals stay unexplained by the card as it is, "
              f"{_percent(left['kept'])} of presses left out")
        print(f"touched signals: size off by {_percent(skin['size_error'])}, r.m.s., counted in sweeps; noise of a "
              f"reading with what the model misses {skin['pattern_V']:.3g} V (--noise-V of `surrogate predict`)")
        if not skin["kept"]:
            print("no group of parameters reads presses left out better, so that the card written has the laws of the "
                  "card as it is, with draws by the prior")
        if skin["odd"]:
            print(f"presses missed by far more than the others: {', '.join(skin['odd'])}; check their labels, since a "
                  "wrong one spoils the fit, and fit again")
        deep = skin["too_deep"]
        for why, names in (("near the rim", [one for one in skin["left_out"] if one not in deep]),
                           ("deeper than load paths are stored", deep)):
            if names:
                print(f"presses left out, {why}: {', '.join(names)}")
        print(f"card of this skin: {out.parent / skin['card']}")
    if document["not_determined"]:
        print(f"not determined by the data: {_by_group(document['not_determined'], document['parameters'])}")
    print(f"absolute model: {document['absolute_model']}" + (f": {document['reason']}" if document["reason"] else ""))
    print(f"sensor: {out}")


def _group(parameter: str) -> str:
    """The name of a parameter without the number of its electrode, mode or reading."""
    return re.sub(r"_\d+$", "", parameter)


def _by_group(some: Sequence[str], parameters: Iterable[str]) -> str:
    """Some of the parameters by their group: how many of it, and which where they are few."""
    of, said = Counter(map(_group, parameters)), []
    for group, count in Counter(map(_group, some)).items():
        numbers = [name.removeprefix(f"{group}_").lstrip("0") or "0" for name in some if _group(name) == group]
        which = f": {', '.join(numbers)}" if count <= _MOST_NUMBERS else ""
        said.append(group if of[group] == 1 else f"{group} (all {count})" if count == of[group] else
                    f"{group} ({count} of {of[group]}{which})")
    return ", ".join(said)


def show_designs(designs: Mapping[Path, SensorDesign]) -> None:
    """Drives and choices of each sensor, the best first, with the bounds of what a touch is read for."""
    first = next(iter(designs.values()))
    table = Table(*["sensor"] * (len(designs) > 1), "drive", "readings", "over own",
                  *(name.replace("_", ", ") for name in first.unknowns), box=box.SIMPLE_HEAD, title_justify="left",
                  title=f"least standard deviations at {first.noise_V:.3g} V a reading, median and 90 % of "
                        f"{first.places} places")
    for path, made in designs.items():
        for one in sorted((*made.drives, *filter(None, [made.choice])), key=lambda each: each.over_own):
            ends = [f"{low:.3g}, {high:.3g}" for low, high in zip(one.median, one.high, strict=True)]
            table.add_row(*[str(path)] * (len(designs) > 1), one.name, str(one.readings), f"{one.over_own:.2f}", *ends)
    _console().print(table)
