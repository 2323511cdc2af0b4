"""Figures of the meshes: the sensor with its electrodes and random scenes, and convergence (paper, figures 7 and 8)."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from eitsim.mechanics.solid.grid import Grid, default_element_m, foam_grid
from eitsim.scene.scene import scene_from
from reports.document import style
from reports.document.numerals import number, percent
from reports.document.page import ReportFigure
from reports.touch.touch_figures import sensor
from touchcal.arrays import Array
from touchcal.errors import InputFileError

_CORNERS = {"triangle": 3, "triangle6": 3, "quad9": 4}  # cell in VTK -> its corners
_SECTION = 3.0  # how far from the axis the section of the foam is drawn, in punch radii
# series -> quantity, its axis
COURSES = {"sigma_ave_kPa": ("mean contact stress", "Mean contact stress (kPa)"),
           "delta_max_mm": ("depth", "Depth (mm)")}
ORDERS = {1: "linear", 2: "quadratic"}


@dataclass(frozen=True)
class Meshed:
    """A scene and the mesh of its skin."""

    scene: Mapping[str, Any]
    edges_mm: Array  # (edges, 2, 2) ends of the elements' straight edges, mm, each edge once
    elements: int


def meshed(scene: Mapping[str, Any], path: Path) -> Meshed:
    """The mesh of a skin from a file of `eitsim run --skin`; InputFileError where its elements are not known."""
    mesh = meshio.vtu.read(path)
    (cells,) = mesh.cells
    if cells.type not in _CORNERS:
        raise InputFileError(path, f"elements '{cells.type}' are not drawn here; write it with `eitsim run --skin`.")
    places = np.round(mesh.points[:, :2] * 1e3, 4)
    ends = places[edges(cells.data[:, : _CORNERS[cells.type]])]
    return Meshed(scene, np.unique(ends, axis=0), len(cells.data))


def edges(corners: NDArray[np.integer]) -> NDArray[np.integer]:
    """(edges, 2) nodes of the edges of (elements, k) corners, each edge once."""
    pairs = np.concatenate([corners[:, [i, (i + 1) % corners.shape[1]]] for i in range(corners.shape[1])])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def meshes(name: str, sensors: Sequence[Meshed]) -> ReportFigure:
    """Meshes of several scenes' skins from above, and the foam's mesh under the first punch (paper, figure 7)."""
    figure = style.sheet(98)
    grid = figure.add_gridspec(2, len(sensors), height_ratios=[3, 1])
    data = {}
    for k, one in enumerate(sensors):
        axes = figure.add_subplot(grid[0, k])
        axes.grid(False)
        _edges(axes, one.edges_mm)
        sensor(axes, one.scene["body"], one.scene["electrodes"])
        _punch(axes, one.scene["punch"][0])
        axes.set_title(f"({'abc'[k]})")
        if k:
            axes.set_ylabel("")
        data[f"{name}_mesh_{'abc'[k]}"] = pd.DataFrame(one.edges_mm.reshape(-1, 4),
                                                       columns=["x_1_mm", "y_1_mm", "x_2_mm", "y_2_mm"])
    foam = _foam(figure.add_subplot(grid[1, :]), sensors[0].scene)
    data[name] = pd.DataFrame([one.scene["punch"][0] | {"skin_elements": one.elements} for one in sensors])
    words = "; ".join(f"({'abc'[k]}) {_words(one.scene['punch'][0])}" for k, one in enumerate(sensors))
    caption = (f"The mesh follows the touch: {words}. The skins have "
               f"{', '.join(str(one.elements) for one in sensors)} quadratic elements. Below: of the foam only a "
               f"half-plane through the punch's axis is meshed, {len(foam.elements)} quadratic elements for (a), "
               "smallest at the edge of the punch.")
    return ReportFigure(name, figure, caption, data)


def _words(punch: Mapping[str, Any]) -> str:
    return (f"{number(punch['diameter_mm'])} mm and {number(punch['force_N'])} N at x = {number(punch['x_mm'])} mm, "
            f"y = {number(punch['y_mm'])} mm")


def _edges(axes: Axes, ends: Array, width: float = 0.12) -> None:
    """All edges as one line with gaps."""
    parted = np.concatenate([ends, np.full((len(ends), 1, 2), np.nan)], axis=1).reshape(-1, 2)
    axes.plot(parted[:, 0], parted[:, 1], color=style.GREY, lw=width, zorder=2)


def _punch(axes: Axes, punch: Mapping[str, Any]) -> None:
    angle = np.linspace(0, 2 * np.pi, 97)
    axes.fill(punch["x_mm"] + punch["diameter_mm"] / 2 * np.cos(angle),
              punch["y_mm"] + punch["diameter_mm"] / 2 * np.sin(angle), color=style.ACCENT, alpha=0.55, lw=0, zorder=3)


def _foam(axes: Axes, tables: Mapping[str, Any]) -> Grid:
    """The foam's mesh near the punch; the whole of it."""
    scene = scene_from({key: tables[key] for key in ("body", "punch")})
    punch = scene.punches[0]
    grid = foam_grid(scene.body, punch, default_element_m(scene.body, punch))
    thickness, radius = scene.body.thickness_m * 1e3, punch.diameter_m / 2 * 1e3
    ends = thickness * grid.nodes[edges(grid.counter_clockwise[:, :4])]
    axes.grid(False)
    _edges(axes, ends[ends[:, :, 0].min(axis=1) <= _SECTION * radius], 0.25)
    axes.fill([0, radius, radius, 0], [0, 0, 1.5, 1.5], color=style.ACCENT, alpha=0.55, lw=0)
    axes.set_xlim(0, _SECTION * radius)
    axes.set_aspect("equal")
    style.label(axes, "Radius from the punch's axis (mm)", "z (mm)")
    return grid


@dataclass(frozen=True)
class ConvergenceSeries:
    """A quantity over meshes that halve their elements, of one order."""

    elements: Array
    value: Array
    observed: float | None  # order of convergence fitted to all changes from mesh to mesh; None where they do not fall
    error: Array  # (meshes,) estimated errors, 0 for the first mesh, which has none before it


def course(rows: pd.DataFrame, column: str) -> ConvergenceSeries:
    """Richardson's estimate: changes d_i between meshes of halved size fall as 2^-p i, and mesh i is off by
    |d_i|/(2^p - 1); p fitted to all changes, at least 0.5 in the estimate."""
    value = rows[column].to_numpy(dtype=float)
    changes = np.abs(np.diff(value))
    observed = -float(np.polyfit(np.arange(len(changes)), np.log2(changes), 1)[0]) if np.all(changes > 0) else None
    power = 2.0 ** max(observed or 0.5, 0.5) - 1
    return ConvergenceSeries(rows["elements"].to_numpy(dtype=float), value,
                             observed if observed and observed > 0 else None,
                             np.concatenate([[0.0], changes / power]))


def courses(table: pd.DataFrame) -> dict[tuple[str, int], ConvergenceSeries]:
    """(column, order of elements) -> its course, of a table of `paper_convergence`."""
    orders = sorted(table["order"].unique())
    return {(column, int(order)): course(pd.DataFrame(table[table["order"] == order]), column)
            for column, order in itertools.product(COURSES, orders)}


def convergence(name: str, table: pd.DataFrame) -> ReportFigure:
    """Mean contact stress and depth over the number of elements, with estimated errors (paper, figure 8)."""
    found = courses(table)
    figure = style.sheet(64)
    for axes, (column, (_, title)) in zip(figure.subplots(1, 2), COURSES.items(), strict=True):
        for k, order in enumerate(order for kept, order in found if kept == column):
            own = found[column, order]
            axes.errorbar(own.elements, own.value, yerr=own.error, color=style.SERIES[k], ls=style.DASHES[k],
                          marker="os"[k], ms=3, capsize=2, elinewidth=0.8, label=f"{ORDERS[order]} elements")
        axes.set_xscale("log")
        style.plain_log(axes.xaxis)
        axes.tick_params(axis="x", which="both", labelrotation=45)
        style.label(axes, "Elements of the half-plane (–)", title)
        axes.legend()
    return ReportFigure(name, figure, _convergence_caption(found), {name: _with_errors(table, found)})


def _with_errors(table: pd.DataFrame, found: Mapping[tuple[str, int], ConvergenceSeries]) -> pd.DataFrame:
    columns = {f"{column}_error": np.concatenate([one.error for (kept, _), one in found.items() if kept == column])
               for column in COURSES}
    return table.sort_values("order", kind="stable").assign(**columns)


def _convergence_caption(found: Mapping[tuple[str, int], ConvergenceSeries]) -> str:
    said = []
    for (column, order), own in found.items():
        how = "falls at no single order" if own.observed is None else f"falls at order {number(own.observed, 2)}"
        said.append(f"{COURSES[column][0]}, {ORDERS[order]}: {how}, "
                    f"{percent(own.error[-1] / abs(own.value[-1]))} at the finest")
    return ("Convergence with elements that halve from mesh to mesh; bars are Richardson's estimates of the error, "
            f"none at the first mesh: {'; '.join(said)}.")
