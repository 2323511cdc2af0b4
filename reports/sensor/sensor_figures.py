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
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.scene import Scene, from_edge_m
from reports.document import style
from reports.document.numerals import number, percent
from reports.document.page import ReportFigure
from reports.touch.sensor_drawing import draw_skin
from touchcal.arrays import Array


def electrodes(sensor: Scene, offset_mm: Array) -> ReportFigure:
    """The electrodes of a calibrated scene from above, coloured by contact impedance; offset_mm (N,) is how far along
    the edge each lies from where its sensor file puts it."""
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
    axes, radius, largest = figure.axes[0], sensor.body.edge.size_m * 1e3, max(float(np.abs(leaks).max()), 1e-9)
    for (x, y), leak in zip(_middles_mm(sensor, -0.2, np.zeros(len(leaks))).tolist(), leaks, strict=True):
        axes.add_patch(Circle((x, y), 0.06 * radius * np.sqrt(abs(leak) / largest), lw=0.8, edgecolor=style.INK,
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
    body, modes = sensor.body, sensor.channels.sheet_modes
    if not any(modes):
        return "The sheet is taken as even."
    x, y = np.linspace(*body.edge.box_m, 101).T
    points = np.stack(np.meshgrid(x, y), axis=-1)
    change = 100 * np.tensordot(np.array(modes), sheet_modes(body, points), 1)
    change[from_edge_m(body, points) < 0] = np.nan
    lines = axes.contour(1e3 * x, 1e3 * y, change, 7, colors=style.GREY, linewidths=0.6)
    axes.clabel(lines, fmt="%g", fontsize=6)
    return (f"Lines: ln of the sheet conductance, off its mean by {number(float(np.nanmin(change)), 2)} to "
            f"{number(float(np.nanmax(change)), 2)} %.")


def _ring(sensor: Scene, offset_mm: Array, value: Array, norm: Normalize, colours: str, words: str) -> Any:
    figure = style.sheet(76, style.HALF_WIDTH_MM)
    axes = figure.subplots()
    axes.grid(False)
    palette = matplotlib.colormaps[colours]
    draw_skin(axes, sensor.body.edge)
    shift = 9 * offset_mm
    for path, each in zip(_paths_mm(sensor, shift), value, strict=True):
        axes.plot(*path.T, solid_capstyle="butt", lw=5, color=palette(norm(each)))
    for k, (x, y) in enumerate(_middles_mm(sensor, 0.13, shift).tolist()):
        axes.text(x, y, str(k), ha="center", va="center", fontsize=6)
    figure.colorbar(ScalarMappable(norm, palette), ax=axes, shrink=0.8, label=words)
    return figure


def _paths_mm(sensor: Scene, shift_mm: Array) -> list[Array]:
    """(n, 2) the stretch of the edge under each electrode, shifted along it."""
    edge = sensor.body.edge
    ends = edge.stretches_m(sensor.electrodes) + 1e-3 * shift_mm[:, None]
    return [1e3 * edge.path_m(first, last) for first, last in ends.tolist()]


def _middles_mm(sensor: Scene, out: float, shift_mm: Array) -> Array:
    """(N, 2) the electrodes' middles shifted along the edge, and outwards by so much of its size."""
    edge = sensor.body.edge
    ends = edge.stretches_m(sensor.electrodes) + 1e-3 * shift_mm[:, None]
    return 1e3 * (edge.along_m(ends.mean(axis=1)) + out * edge.size_m * edge.outwards(ends))
