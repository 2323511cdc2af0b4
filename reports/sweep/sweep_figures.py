"""Figures of a data set: touches on the disc, distributions of what went in and came out, error and cost."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from reports.document import style
from reports.document.numerals import counted, number, percent, volts
from reports.document.page import ReportFigure
from reports.touch.reading_figures import Array
from reports.touch.touch_figures import sensor

SPREAD = 100  # a histogram of values that span more than this has a logarithmic axis
LEAST_CROSS = 14.0  # least area of a mark that must be seen among thousands, points squared
Columns = Mapping[str, Array]  # columns of a data set, each (scenes,) numbers

# column -> name, unit
LABELS = {"x_mm": ("x", "mm"), "y_mm": ("y", "mm"), "d_mm": ("Punch diameter", "mm"), "F_N": ("Force", "N"),
          "sigma_max_kPa": ("Peak pressure", "kPa"), "sigma_ave_kPa": ("Mean pressure", "kPa"),
          "A_c_mm2": ("Contact area", "mm²"), "delta_max_mm": ("Depth", "mm")}


def axis_label(column: str) -> str:
    """Name and unit of a column as they stand on an axis."""
    name, unit = LABELS[column]
    return f"{name} ({unit})"


def touch_map(ok: Columns, failed: Columns, rms: Array, tables: Mapping[str, Any]) -> ReportFigure:
    """Touches on the disc, coloured by the RMS of their signal; `rms` (ok scenes,), V."""
    factor, unit = volts(rms)
    figure = style.sheet(64, 78)
    axes = figure.subplots()
    sensor(axes, tables["body"], tables["electrodes"])
    norm = LogNorm() if rms.min() > 0 and rms.max() > 3 * rms.min() else Normalize()
    size = _dot(rms.size)
    dots = axes.scatter(ok["x_mm"], ok["y_mm"], c=rms * factor, s=size, cmap=style.SEQUENTIAL, norm=norm, lw=0,
                        zorder=3, label="ok")
    lost = failed["x_mm"].size
    if lost:
        axes.scatter(failed["x_mm"], failed["y_mm"], marker="x", color=style.SECOND, s=max(size, LEAST_CROSS), lw=0.9,
                     zorder=4, label="another outcome")
        for dot in axes.legend(loc="upper left", bbox_to_anchor=(0, 1.12), ncols=2).legend_handles:
            dot.set_sizes([LEAST_CROSS])  # pyright: ignore[reportOptionalMemberAccess, reportAttributeAccessIssue]
    bar = figure.colorbar(dots, ax=axes, label=f"RMS of the signal ΔV ({unit})", shrink=0.85)
    if isinstance(norm, LogNorm):
        style.plain_log(bar.ax.yaxis)
    caption = (f"{counted(rms.size, 'touch', 'touches')} by place; the RMS of the signal runs from "
               f"{number(rms.min() * factor)} to {number(rms.max() * factor)} {unit}.")
    if lost:
        caption += f" The {counted(lost, 'touch', 'touches')} with another outcome and a known place are crosses."
    data = _frame(ok, ("scene", "x_mm", "y_mm", "d_mm", "F_N"), signal_rms_V=rms)
    return ReportFigure("map", figure, caption, {"map": data})


def _dot(count: int) -> float:
    """Area of a dot, points squared: smaller where there are many."""
    return float(np.clip(6000 / max(count, 1), 3, 22))


def _frame(columns: Columns, names: Sequence[str], **more: Array) -> pd.DataFrame:
    return pd.DataFrame({name: columns[name] for name in names} | more)


def ranges(ok: Columns, inputs: Sequence[str], outputs: Sequence[str]) -> ReportFigure:
    """One histogram a column: what was drawn above, what came out below."""
    figure = style.sheet(45)
    panels = figure.subplots(2, max(len(inputs), len(outputs)), sharey="row", squeeze=False)
    for line, columns in zip(panels, (inputs, outputs), strict=True):
        for axes, column in zip(line, columns, strict=False):
            _histogram(axes, ok[column], axis_label(column))
        for axes in line[len(columns):]:
            axes.set_visible(False)
        style.label(line[0], axis_label(columns[0]), "Scenes (–)")
    said = [", ".join(f"{LABELS[c][0].lower()} {number(ok[c].min())} to {number(ok[c].max())} {LABELS[c][1]}"
                      for c in columns) for columns in (inputs, outputs)]
    caption = f"Over {counted(ok['scene'].size, 'scene')}, drawn: {said[0]}; what came out: {said[1]}."
    return ReportFigure("ranges", figure, caption, {"ranges": _frame(ok, ("scene", *inputs, *outputs))})


def _histogram(axes: Axes, values: Array, x: str) -> None:
    count = min(20, max(5, values.size // 8))
    wide = values.min() > 0 and values.max() > SPREAD * values.min()
    bins = np.geomspace(values.min(), values.max(), count + 1) if wide else count
    axes.set_xscale("log" if wide else "linear")
    axes.hist(values, bins=bins, histtype="stepfilled", color=style.ACCENT)
    axes.grid(axis="x", visible=False)
    style.label(axes, x, "")


def accuracy(ok: Columns) -> ReportFigure:
    """Estimated error of the signal against the force, and the CPU time of a scene."""
    error, cost = ok["signal_error"], ok["cpu_s"]
    figure = style.sheet(36, 100)
    left, right = figure.subplots(1, 2)
    left.scatter(ok["F_N"], 100 * error, s=_dot(error.size) / 2, color=style.ACCENT, lw=0)
    left.set_yscale("log" if error.min() > 0 and error.max() > 10 * error.min() else "linear")
    style.label(left, "Force (N)", "Signal error (%)")
    _histogram(right, cost, "CPU time a scene (s)")
    style.label(right, "CPU time a scene (s)", "Scenes (–)")
    worst = int(np.argmax(error))
    caption = (f"Error and cost: the estimated signal error is largest, {percent(error[worst])}, in scene "
               f"{int(ok['scene'][worst])} ({number(ok['d_mm'][worst])} mm, {number(ok['F_N'][worst])} N); the median "
               f"scene costs {number(float(np.median(cost)))} s of CPU.")
    return ReportFigure("accuracy", figure, caption,
                        {"accuracy": _frame(ok, ("scene", "F_N", "d_mm", "signal_error", "cpu_s"))})
