"""What the terminal shows of plans, results, models and images: tables for people, the files that were written."""

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from eitsim.scene.results import Plan, Result


def show_plan(made: Plan) -> None:
    table = Table("decision", "reason", "may cost of dV", title="plan")
    for d in made.decisions:
        table.add_row(escape(d.decision), escape(d.reason), f"{d.error_bound:.1e}" if d.error_bound else "-")
    table.add_section()
    table.add_row("all of them", "", f"{made.error_bound:.1e}")
    Console().print(table)


def show_result(result: Result, document: dict[str, Any]) -> None:
    show_plan(result.plan)
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
        keys = ("time_s", "delta_max_mm", "force_N", "sigma_ave_kPa", "sigma_max_kPa", "A_c_mm2")
        table = Table(*keys, title="hold, from the end of loading")
        for block in document["times"]:
            table.add_row(*(f"{block[key]:.5g}" for key in keys))
        Console().print(table)


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
    Console().print(table)
    if out is not None:
        print(f"result: {out}")


def show_images(document: dict[str, Any], out: Path | None) -> None:
    keys = ("line", "x_mm", "y_mm", "area_mm2", "peak")
    table = Table(*keys, title="images: quarter-amplitude area, its centre, largest relative change of conductance")
    for image in document["frames"]:
        table.add_row(*("-" if image[key] is None else f"{image[key]:.4g}" for key in keys))
    Console().print(table)
    for image in document["frames"]:
        if "note" in image:
            print(f"line {image['line']}: {image['note']}")
    print(f"untouched: {document['conductance_S']:.4g} S a square, misfit {document['misfit']:.2%}; prior "
          f"{document['prior']}, noise figure {document['noise_figure']:.3g}")
    if out is not None:
        print(f"images: {out}")


def _add_ranges(table: Table, stability: dict[str, Any]) -> None:
    """Rows that set the least strain against the fitted ones; below them the laws are extrapolated."""
    table.add_row("least strain of the surface", f"{stability['least_strain']:.3f}")
    for part in ("foam", "skin"):
        fitted = stability[f"fitted_{part}_strain"]
        words = "not stated by the card"
        if fitted is not None:
            words = " to ".join(f"{round(end, 3) + 0.0:g}" for end in fitted)
            words += ", extrapolated" if stability["least_strain"] < fitted[0] else ""
        table.add_row(f"{part} law fitted over", words)
    share = stability.get("signal_share_extrapolated")
    table.add_row("skin outside its fit", f"{stability['skin_fraction_extrapolated']:.2%} of the disc"
                  + ("" if share is None else f", {share:.0%} of the signal"))
