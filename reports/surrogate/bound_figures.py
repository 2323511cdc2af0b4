"""Maps of the physical limit over the skin: what any reading of a frame leaves open of a touch, by its place."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from reports.document import style
from reports.document.numerals import number
from reports.document.page import ReportFigure
from reports.surrogate.parity_figures import label
from surrogate.bounds.bound_files import MATERIALS

OUTPUTS = {"x0": ("sd_x0_mm", "mm"), "y0": ("sd_y0_mm", "mm"), "d": ("sd_d_mm", "mm"), "F": ("sd_F_N", "N")}
WORDS = {"known": "material known", "posterior": "material uncertain"}


def plates(found: pd.DataFrame) -> list[ReportFigure]:
    """One plate a noise level of a map as `limit_file.read_map` gives it, loudest last."""
    return [_plate(pd.DataFrame(found.loc[found["noise_db"] == level]), float(level))
            for level in sorted(found["noise_db"].unique(), reverse=True)]


def _plate(found: pd.DataFrame, level: float) -> ReportFigure:
    materials = [name for name in MATERIALS if name in set(found["material"])]
    figure = style.sheet(14 + 46 * len(materials))
    panels = figure.subplots(len(materials), len(OUTPUTS), squeeze=False, sharex=True, sharey=True)
    for column, (output, (name, unit)) in enumerate(OUTPUTS.items()):
        values = found[name].to_numpy(float)
        shades = LogNorm(float(values.min()), float(values.max()))
        drawn = [_panel(axes, pd.DataFrame(found.loc[found["material"] == material]), name, shades)
                 for axes, material in zip(panels[:, column], materials, strict=True)]
        bar = figure.colorbar(drawn[0], ax=list(panels[:, column]), location="bottom", shrink=0.9, aspect=18,
                              label=f"Standard deviation ({unit})")
        bar.ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0), numticks=4))
        bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        bar.ax.xaxis.set_minor_formatter(NullFormatter())
        panels[0, column].set_title(label(output))
    for axes, material in zip(panels[:, 0], materials, strict=True):
        style.label(axes, "", f"{WORDS[material]}\ny (mm)", axes.get_title("left"))
    for axes in panels[-1]:
        style.label(axes, "x (mm)", axes.get_ylabel(), axes.get_title("left"))
    name = f"limit_map_{level:g}dB".replace(".", "_")
    return ReportFigure(name, figure, _caption(found, level, materials), {name: found})


def _panel(axes: Axes, part: pd.DataFrame, name: str, shades: LogNorm) -> Collection:
    x, y = part["x_mm"].to_numpy(float), part["y_mm"].to_numpy(float)
    drawn = axes.tripcolor(Triangulation(x, y), part[name].to_numpy(float), norm=shades, cmap=style.SEQUENTIAL,
                           shading="gouraud", rasterized=True)
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set_xticks(_ticks(x))
    axes.set_yticks(_ticks(y))
    return drawn


def _ticks(values: NDArray[np.float64]) -> list[float]:
    """Both ends to 10 mm outwards, and 0 between them."""
    low, high = 10 * np.floor(values.min() / 10), 10 * np.ceil(values.max() / 10)
    return [low, 0.0, high] if low < 0 < high else [low, high]


def _caption(found: pd.DataFrame, level: float, materials: list[str]) -> str:
    said = []
    for material in materials:
        part = found.loc[found["material"] == material]
        centre = int(np.hypot(part["x_mm"], part["y_mm"]).to_numpy().argmin())
        ends = [f"{label(output).lower()} {number(part[name].iloc[centre])} and {number(part[name].min())} {unit}"
                for output, (name, unit) in OUTPUTS.items() if output != "y0"]
        said.append(f"{WORDS[material]}: {', '.join(ends)}")
    return (f"The least standard deviation of an unbiased reading of one frame (Cramér–Rao, no prior) with noise "
            f"{number(level)} dB below the RMS of the baseline voltages, by the place of a punch of "
            f"{number(found['d_mm'].iloc[0])} mm under {number(found['F_N'].iloc[0])} N. At the centre and where it is "
            f"least, {'; '.join(said)}.")
