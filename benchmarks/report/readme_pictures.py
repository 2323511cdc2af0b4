"""The two pictures of the README: a touch, and error against run time."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.report.catalogue import BENCHES, by_problem, points
from benchmarks.report.precision_figures import panel
from eitsim.sheet.sheet_conductance import driving_strain
from reports.document import style
from reports.touch.reading_figures import curve_panels
from reports.touch.touch_figures import sensor
from reports.touch.touch_report import read_result

# benchmarks drawn, of each its first problem
DRAWN = ("fit", "peers_mechanics", "peers_signal")
SIDE, DOTS_PER_INCH = 400, 160
LABELS = {"normal": "Strain through the thickness (%)", "principal": "Largest strain in plane (%)",
          "areal": "Change of area (%)"}


def write(result: Path, results: Path, out: Path) -> list[Path]:
    """Write touch.png, of a result of `eitsim run`, and precision.png, of the benchmarks' tables, into a folder."""
    with style.house():
        drawn = {"touch": touch(read_result(result)), "precision": precision(results)}
        out.mkdir(parents=True, exist_ok=True)
        written = [out / f"{name}.png" for name in drawn]
        for path, figure in zip(written, drawn.values(), strict=True):
            figure.savefig(path, dpi=DOTS_PER_INCH, metadata={"Software": None})
    return written


def touch(result: Mapping[str, Any]) -> Figure:
    """Strain that drives the skin, over the disc, of the first touch, as if alone, and the readings of all."""
    scene, block = result["scene"], result["profile"][0]
    figure = style.sheet(66)
    left, right = figure.subfigures(1, 2, width_ratios=[1, 1.45], squeeze=False)[0]
    axes = left.subplots()
    along = (block[f"stretch_{name}"] for name in ("meridian", "hoop", "normal"))
    _strain(left, axes, scene, np.array(block["radius_mm"]), 100 * driving_strain(scene["skin"]["strain"], *along))
    upper, lower = right.subplots(2, 1, sharex=True)
    curve_panels(upper, lower, *(np.array(result[key], dtype=float) for key in ("readings_V", "baseline_V")))
    return figure


def _strain(figure: Any, axes: Axes, scene: Mapping[str, Any], radius_mm: np.ndarray, percent: np.ndarray) -> None:
    disc_mm, punch = scene["body"]["radius_mm"], scene["punch"][0]
    x, y = np.meshgrid(*2 * [np.linspace(-disc_mm, disc_mm, SIDE)])
    strain = np.interp(np.hypot(x - punch["x_mm"], y - punch["y_mm"]), radius_mm, percent)
    strain[np.hypot(x, y) > disc_mm] = np.nan
    most = np.nanmax(np.abs(strain))
    image = axes.imshow(strain, origin="lower", extent=(-disc_mm, disc_mm, -disc_mm, disc_mm), cmap=style.DIVERGING,
                        vmin=-most, vmax=most, zorder=1.2)
    sensor(axes, disc_mm, scene["electrodes"])
    figure.colorbar(image, ax=axes, label=LABELS[scene["skin"]["strain"]], shrink=0.8)


def precision(results: Path) -> Figure:
    """Error against CPU time of a fit, of a touch's depth and of its readings, with peers."""
    figure = style.sheet(92)
    panels = figure.subplots(1, len(DRAWN))
    for axes, name in zip(panels, DRAWN, strict=True):
        bench = next(bench for bench in BENCHES if bench.name == name)
        found, _ = points(bench, results)
        problem, own = next(iter(by_problem(found).items()))
        panel(axes, bench, own, list(dict.fromkeys(p.method for p in own)))
        style.label(axes, "CPU time (s)", bench.label, problem if len(problem) < 40 else problem[:problem.rindex(",")])
        lines = {line.get_label(): line for line in axes.get_lines() if not str(line.get_label()).startswith("_")}
        axes.legend(lines.values(), lines.keys(), loc="upper center", bbox_to_anchor=(0.45, -0.2), fontsize=6.5)
    return figure
