"""Figure of cyclic tests over their cycles: settling resistance (paper, figure 6b), or loss and set of a foam."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from reports.document import style
from reports.document.numerals import number, pascals, percent, plus_minus, prefixed
from reports.document.page import ReportFigure

# column -> what it is, unit of the column
COLUMNS = {"resistance_rest_Ohm": ("at rest", "Ω"), "resistance_peak_Ohm": ("at the peak", "Ω"),
           "peak_stress_Pa": ("Peak stress", "Pa"), "loss_Pa": ("Loss in a cycle", "Pa"),
           "residual_strain": ("Residual strain", "–")}
STEADY = 0.01  # change of a cycle, of its value, below which a course counts as steady


def cycles(label: str, table: pd.DataFrame, row: Mapping[str, Any]) -> ReportFigure:
    """What a cyclic test measured in each cycle, with the fitted courses where the table has them; `row` of the fit."""
    held = [name for name in COLUMNS if name in table]
    resistance = [name for name in held if name.startswith("resistance")]
    panels = [resistance] if resistance else [[name] for name in held]
    figure = style.sheet(58)
    for axes, names in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _draw(axes, table, names)
    what = "resistance" if resistance else "cycles of loading"
    caption = f"Settling, {label}: {what} over {len(table)} cycles. " + " ".join(_course(table, name) for name in held)
    caption += _settled(row)
    return ReportFigure(f"{label}_cycles", figure, caption, {f"{label}_cycles": table})


def path(stem: str, table: pd.DataFrame, relative_rms: float) -> ReportFigure:
    """Stress along the whole path of a cyclic test, measured and fitted."""
    figure = style.sheet(66, style.HALF_WIDTH_MM)
    axes = figure.subplots()
    factor, unit = pascals(table["stress_Pa"].to_numpy(dtype=float))
    axes.plot(table["strain"], factor * table["stress_Pa"], "o", color=style.INK, ms=1.2, mew=0, label="measured")
    axes.plot(table["strain"], factor * table["fit_stress_Pa"], color=style.ACCENT, lw=0.8, label="softened law")
    axes.legend(loc="best")
    style.label(axes, "Nominal strain (–)", f"Stress ({unit})")
    caption = (f"Loading and unloading, {stem.removesuffix('_path')}: the law with what cycles leave misses the path "
               f"by {percent(relative_rms)} (relative RMS).")
    return ReportFigure(f"{stem}_cycles", figure, caption, {stem: table})


def _settled(row: Mapping[str, Any]) -> str:
    """What the fitted course says of the resistance at rest, where the card holds it."""
    if not {"settling_cycles", "settling_cycles_sd", "settling_final_Ohm", "settling_final_sd_Ohm"} <= row.keys():
        return ""
    factor, unit = prefixed([row["settling_final_Ohm"]], "Ω")
    final = plus_minus(factor * row["settling_final_Ohm"], factor * row["settling_final_sd_Ohm"])
    return (f" At rest it settles with a constant of {plus_minus(row['settling_cycles'], row['settling_cycles_sd'])} "
            f"cycles to {final} {unit} (one standard error).")


def _draw(axes: Axes, table: pd.DataFrame, names: list[str]) -> None:
    values = table[names].to_numpy(dtype=float)
    unit = COLUMNS[names[0]][1]
    factor, shown = (1.0, "–") if unit == "–" else prefixed(values[np.isfinite(values)], unit)
    for k, name in enumerate(names):
        colour, words = style.SERIES[k], COLUMNS[name][0]
        axes.plot(table["cycle"], factor * table[name], "o", color=colour, ms=2.6, mew=0, label=words)
        if f"fit_{name}" in table:
            axes.plot(table["cycle"], factor * table[f"fit_{name}"], color=colour, ls=style.DASHES[k],
                      label=f"{words}, fitted")
    style.label(axes, "Cycle (–)", f"{'Resistance' if unit == 'Ω' else COLUMNS[names[0]][0]} ({shown})")
    if len(names) > 1 or f"fit_{names[0]}" in table:
        axes.legend(loc="best")


def _course(table: pd.DataFrame, name: str) -> str:
    """From where to where a column runs, and from which cycle on it is steady."""
    words, unit = COLUMNS[name]
    values, cycle = table[name].to_numpy(dtype=float), table["cycle"].to_numpy(dtype=float)
    values, cycle = values[np.isfinite(values)], cycle[np.isfinite(values)]
    factor, shown = (1.0, "") if unit == "–" else prefixed(values, unit)
    ends = f"{number(factor * values[0])} to {number(factor * values[-1])} {shown}".rstrip()
    said = f"{words[0].upper()}{words[1:]}: {ends}"
    steps = np.abs(np.diff(values)) > STEADY * np.abs(values[1:])
    moving = np.flatnonzero(steps)
    if not moving.size:
        return f"{said}, steady to {number(100 * STEADY, 1)} % a cycle throughout."
    if moving[-1] == steps.size - 1:
        return f"{said}, still changing by more than {number(100 * STEADY, 1)} % a cycle at the end."
    return f"{said}, steady to {number(100 * STEADY, 1)} % a cycle from cycle {cycle[moving[-1] + 1]:.0f} on."
