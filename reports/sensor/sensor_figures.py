"""Figures of a calibrated sensor: electrodes where they lie, their channels, and what is not explained."""

from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from eitsim.electrics.cem.uneven_sheet import sheet_modes
from eitsim.scene.electrodes import arcs, contact_impedances
from eitsim.scene.scene import Scene
from reports.document import style
from reports.document.numerals import number, percent
from reports.document.page import ReportFigure
from touchcal.arrays import Array


def electrodes(sensor: Scene, offset_mm: Array) -> ReportFigure:
    """The electrodes of a calibrated scene from above, coloured by contact impedance; offset_mm (N,) is how far along
    the rim each lies from where its sensor file puts it."""
    impedance = contact_impedances(sensor.electrodes)
    low, high = float(impedance.min()), float(impedance.max())
    figure = _ring(sensor, offset_mm, impedance, LogNorm(low, max(high, 1.01 * low)), style.SEQUENTIAL,
                   "Contact impedance (Ω m)")
    poorest = int(np.argmax(impedance))
    uneven = _draw_sheet(figure.axes[0], sensor)
    caption = (f"Electrodes from above where the calibration puts them, displacements ten times too large, by contact "
               f"impedance: {number(low)} to {number(high)} Ω m; electrode {poorest} has the poorest contact. {uneven}")
    return ReportFigure("electrodes", figure, caption, {"electrodes": pd.DataFrame({
        "electrode": np.arange(len(impedance)), "contact_impedance_Ohm_m": impedance})})


def channels(sensor: Scene, offset_mm: Array) -> ReportFigure:
    """The electrodes coloured by the gain of their channels, leaks as circles inside; offset_mm as in `electrodes`."""
    gains, leaks = 100 * (np.array(sensor.channels.gains) - 1), 1e6 * np.array(sensor.channels.leaks_S)
    most = max(float(np.abs(gains).max()), 1e-3)
    figure = _ring(sensor, offset_mm, gains, Normalize(-most, most), style.DIVERGING, "Gain less the mean (%)")
    axes, radius, largest = figure.axes[0], sensor.body.radius_m * 1e3, max(float(np.abs(leaks).max()), 1e-9)
    for (start, stop), leak in zip(arcs(sensor.body.radius_m, sensor.electrodes), leaks, strict=True):
        middle = (start + stop) / 2
        axes.add_patch(Circle((0.8 * radius * np.cos(middle), 0.8 * radius * np.sin(middle)),
                              0.06 * radius * np.sqrt(abs(leak) / largest), lw=0.8, edgecolor=style.INK,
                              facecolor=style.GREY if leak < 0 else "none"))
    caption = (f"Gains of the channels against ground, off their mean by at most {number(most, 2)} %. Circles inside: "
               f"leaks to ground by area, the largest {number(largest, 2)} uS; filled ones came out negative, which no "
               "leak is.")
    return ReportFigure("channels", figure, caption, {"channels": pd.DataFrame({
        "electrode": np.arange(len(gains)), "gain_percent": gains, "leak_uS": leaks})})


def stages(document: Mapping[str, Any]) -> ReportFigure:
    """What is left of the readings, stage by stage, on drives fitted and not."""
    found = document["unexplained"]
    figure = style.sheet(62, style.HALF_WIDTH_MM)
    axes = figure.subplots()
    at = np.arange(len(found))
    for shift, key, colour in ((-0.2, "fitted", style.GREY), (0.2, "held_out", style.ACCENT)):
        axes.bar(at + shift, [100 * max(one[key], 1e-7) for one in found.values()], 0.38, color=colour,
                 label=key.replace("_", " "))
    axes.set_yscale("log")
    style.plain_log(axes.yaxis)
    axes.set_xticks(at, [*found], rotation=40, ha="right")
    axes.set_ylim(top=6 * axes.get_ylim()[1])
    axes.legend(loc="upper right")
    style.label(axes, "", "Unexplained (%)")
    last = found[document["stage"]]
    caption = (f"Readings off the driven electrodes that stay unexplained as groups of parameters are freed, on the "
               f"half of the drives that is fitted and on the other: {percent(last['held_out'])} in the end.")
    return ReportFigure("stages", figure, caption, {"stages": pd.DataFrame(
        [{"stage": name, **one} for name, one in found.items()])})


def residuals(document: Mapping[str, Any]) -> ReportFigure:
    """What is left of the readings at each electrode."""
    left = 100 * np.array(document["unexplained_by_electrode"])
    figure = style.sheet(62, style.HALF_WIDTH_MM)
    axes: Axes = figure.subplots()
    axes.bar(np.arange(len(left)), left, color=style.ACCENT)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    style.label(axes, "Electrode (–)", "Unexplained (%)")
    worst = int(np.argmax(left))
    caption = (f"What the last fit leaves of the readings at each electrode, off the driven ones: at most "
               f"{number(float(left[worst]), 2)} %, at electrode {worst}; in the median "
               f"{number(float(np.median(left)), 2)} %.")
    return ReportFigure("residuals", figure, caption, {"residuals": pd.DataFrame({
        "electrode": np.arange(len(left)), "unexplained_percent": left})})


def _draw_sheet(axes: Axes, sensor: Scene) -> str:
    """Lines of equal sheet conductance, and the sentence on them."""
    radius, modes = sensor.body.radius_m * 1e3, sensor.channels.sheet_modes
    if not any(modes):
        return "The sheet is taken as even."
    side = np.linspace(-1, 1, 101)
    points = np.stack(np.meshgrid(side, side), axis=-1)
    change = 100 * np.tensordot(np.array(modes), sheet_modes(points), 1)
    change[np.hypot(points[..., 0], points[..., 1]) > 1] = np.nan
    lines = axes.contour(radius * side, radius * side, change, 7, colors=style.GREY, linewidths=0.6)
    axes.clabel(lines, fmt="%g", fontsize=6)
    return (f"Lines: ln of the sheet conductance, off its mean by {number(float(np.nanmin(change)), 2)} to "
            f"{number(float(np.nanmax(change)), 2)} %.")


def _ring(sensor: Scene, offset_mm: Array, value: Array, norm: Normalize, colours: str, words: str) -> Any:
    radius = sensor.body.radius_m * 1e3
    figure = style.sheet(76, style.HALF_WIDTH_MM)
    axes = figure.subplots()
    axes.grid(False)
    axes.add_patch(Circle((0, 0), radius, facecolor="#f7f7f7", edgecolor=style.GREY, lw=0.6))
    ends = arcs(sensor.body.radius_m, sensor.electrodes)
    shift = 9 * (offset_mm - np.mean(offset_mm)) / radius
    palette = matplotlib.colormaps[colours]
    for k, ((start, stop), each, moved) in enumerate(zip(ends, value, shift, strict=True)):
        arc = np.linspace(start, stop, 9) + moved
        axes.plot(radius * np.cos(arc), radius * np.sin(arc), solid_capstyle="butt", lw=5, color=palette(norm(each)))
        axes.text(1.13 * radius * np.cos(arc[4]), 1.13 * radius * np.sin(arc[4]), str(k), ha="center", va="center",
                  fontsize=6)
    axes.set_aspect("equal")
    axes.set_xlim(-1.22 * radius, 1.22 * radius)
    axes.set_ylim(-1.22 * radius, 1.22 * radius)
    style.label(axes, "x (mm)", "y (mm)")
    figure.colorbar(ScalarMappable(norm, palette), ax=axes, shrink=0.8, label=words)
    return figure


