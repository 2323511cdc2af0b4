"""Errors of a surrogate under noise, over the least that any reading of the same frames can reach."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from reports.document import style
from reports.document.numerals import counted, number
from reports.document.page import ReportFigure
from reports.surrogate.parity_figures import label, unit, unseen
from surrogate.bounds.bound_files import MATERIALS, floor

NAME = "noise"
NARROW = 1.2  # least span of a panel, upper over lower end
DASHES = {"known": "--", "posterior": ":"}  # how the least error is drawn, by what `surrogate limit` calls the material


def plate(by_output: Mapping[str, Any], levels: Sequence[Mapping[str, Any]],
          limits: pd.DataFrame | None) -> ReportFigure:
    """RMSE of unseen rows over the level of the noise, one panel an output."""
    columns = min(4, len(by_output))
    lines = -(-len(by_output) // columns)
    figure = style.sheet(14 + 36 * lines, style.TEXT_WIDTH_MM if columns > 2 else 83 * columns)
    panels = list(figure.subplots(lines, columns, squeeze=False).flat)
    rows = []
    for axes, (output, parts) in zip(panels, by_output.items(), strict=False):
        part = unseen(parts)
        measured = [(level["db_below_baseline"], level["outputs"][output][part]["rmse"]) for level in levels]
        _panel(axes, output, parts, measured, limits)
        rows += [{"output": output, "noise_db": level, "rmse": rmse} for level, rmse in measured]
    for axes in panels[len(by_output):]:
        axes.axis("off")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return ReportFigure(NAME, figure, _caption(by_output, levels, limits), {NAME: pd.DataFrame(rows)})


def _panel(axes: Axes, output: str, parts: Mapping[str, Any], measured: list[tuple[float, float]],
           limits: pd.DataFrame | None) -> None:
    axes.axhline(parts[unseen(parts)]["rmse"], color=style.GREY, lw=0.8, label="RMSE without noise")
    axes.plot(*zip(*sorted(measured), strict=True), "o-", color=style.ACCENT, label="RMSE under noise")
    for material, words in MATERIALS.items():
        least = floor(limits, output, material)
        if least:
            axes.plot(*zip(*sorted(least.items()), strict=True), DASHES[material], marker="s", color=style.SECOND,
                      label=words)
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    if high < NARROW * low:
        axes.set_ylim((low * high / NARROW) ** 0.5, (low * high * NARROW) ** 0.5)
    style.plain_log(axes.yaxis)
    axes.invert_xaxis()
    style.label(axes, "Noise level (dB)", f"RMSE ({unit(parts)})", label(output))


def _caption(by_output: Mapping[str, Any], levels: Sequence[Mapping[str, Any]], limits: pd.DataFrame | None) -> str:
    loudest = min(levels, key=lambda level: level["db_below_baseline"])
    shown = {output: unseen(parts) for output, parts in by_output.items()}
    grown = [loudest["outputs"][output][part]["rmse"] / by_output[output][part]["rmse"]
             for output, part in shown.items()]
    said = (f"RMSE of unseen rows under {counted(len(levels), 'level')} of white noise, dB below the "
            "RMS of the baseline, by output: at "
            f"{number(loudest['db_below_baseline'])} dB {number(min(grown))} to {number(max(grown))} times that "
            "without noise.")
    ratios = {}
    for output, part in shown.items():
        for level in levels:
            least = floor(limits, output, "known").get(round(level["db_below_baseline"], 1), 0.0)
            if least > 0:
                rmse = level["outputs"][output][part]["rmse"]
                ratios[output, level["db_below_baseline"]] = rmse / least
    if not ratios:
        return said
    (output, level), most = max(ratios.items(), key=lambda item: item[1])
    worst = f"{label(output).lower()} at {number(level)} dB"
    return (f"{said} Against the least that any method can reach with a known material, the error is "
            f"{number(min(ratios.values()))} to {number(most)} times as large (most: {worst}).")
