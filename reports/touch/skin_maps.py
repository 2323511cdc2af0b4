"""Maps of a touched skin from the file of `eitsim run --skin`: equipotential lines, pressure, strain, displacement."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

import meshio
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from reports.document import style
from reports.document.numerals import number, volts
from reports.document.page import ReportFigure
from reports.touch.touch_figures import sensor
from touchcal.arrays import Array
from touchcal.errors import InputFileError

# Cell in VTK -> the triangles of its nodes that are drawn.
_TRIANGLES = {"triangle": [(0, 1, 2)], "triangle6": [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
              "quad9": [(0, 4, 8), (0, 8, 7), (4, 1, 5), (4, 5, 8), (8, 5, 2), (8, 2, 6), (7, 8, 6), (7, 6, 3)]}
_SAME_MM = 1e-6  # Points closer than this, mm, are one.
# Half width of the maps about the punches, in their largest radius, and how many lines are drawn.
_ABOUT, _LINES = 2.0, 21
NEEDED = ("displacement_m", "contact_pressure_Pa", "largest_in_plane_strain")


@dataclass(frozen=True, eq=False)
class SkinMap:
    """A skin cut into triangles, and fields at their corners."""

    triangles: Triangulation  # places on the untouched surface, mm
    fields: Mapping[str, Array]  # name -> values (points,) or (points, 3), units in the names
    patterns: tuple[int, ...]  # numbers of the drive patterns whose potentials it holds


def read(path: Path) -> SkinMap:
    """A file of `eitsim run --skin`, points at one place made one; InputFileError where it is none."""
    try:
        mesh = meshio.vtu.read(path)
    except (meshio.ReadError, ParseError, OSError) as error:
        raise InputFileError(path, f"not a VTU file of `eitsim run --skin`: {error}.") from None
    (cells,) = mesh.cells
    fields = {name: np.asarray(values, dtype=float) for name, values in mesh.point_data.items()}
    missing = [name for name in NEEDED if name not in fields]
    if missing or cells.type not in _TRIANGLES:
        raise InputFileError(path, "not a VTU file of `eitsim run --skin`: it lacks "
                                   f"{', '.join(missing) or 'triangles'}. Write it again with this version.")
    corners = np.concatenate([cells.data[:, list(three)] for three in _TRIANGLES[cells.type]])
    places = mesh.points[:, :2] * 1e3
    _, first, merged = np.unique(np.round(places / _SAME_MM).astype(np.int64), axis=0, return_index=True,
                                 return_inverse=True)
    corners = merged.ravel()[corners]
    flat = (corners[:, [0, 1, 2]] == corners[:, [1, 2, 0]]).any(axis=1)
    share = np.bincount(merged.ravel())
    fields = {name: _means(values, merged.ravel(), share) for name, values in fields.items()}
    patterns = sorted(int(name.rsplit("_", 1)[1]) for name in fields if name.startswith("potential_V_"))
    return SkinMap(Triangulation(places[first, 0], places[first, 1], corners[~flat]), fields, tuple(patterns))


def _means(values: Array, merged: NDArray[np.integer], share: NDArray[np.integer]) -> Array:
    columns = values.reshape(len(values), -1)
    out = np.column_stack([np.bincount(merged, column) / share for column in columns.T])
    return out[:, 0] if values.ndim == 1 else out


def apart(patterns: Sequence[int]) -> tuple[int, ...]:
    """The first pattern and the one a quarter of the way on; one alone where there is no other."""
    return tuple(sorted({patterns[0], patterns[len(patterns) // 4 or -1]}))


def equipotentials(skin: SkinMap, scene: Mapping[str, Any], patterns: Sequence[int]) -> ReportFigure:
    """Lines of equal potential of drive patterns without the touch, with it, and of its change (paper, figure 1)."""
    figure = style.sheet(44 * len(patterns))
    panels = figure.subplots(len(patterns), 3, squeeze=False, sharex=True, sharey=True)
    data: dict[str, Array] = {"x_mm": skin.triangles.x, "y_mm": skin.triangles.y}
    sizes = []
    for row, k in zip(panels, patterns, strict=True):
        touched, free = (_potential(skin, name, k) for name in ("potential_V", "untouched_potential_V"))
        data |= {f"untouched_V_{k}": free, f"touched_V_{k}": touched}
        levels, change = (_levels(skin.triangles, values) for values in (free, touched - free))
        for axes, values, drawn, title in ((row[0], free, levels, "untouched"), (row[1], touched, levels, "touched"),
                                           (row[2], touched - free, change, "change")):
            _disc(axes, scene)
            axes.tricontour(skin.triangles, values, levels=drawn, linewidths=0.6,
                            colors=style.ACCENT if title != "change" else style.SECOND)
            axes.set_title(f"pattern {k}, {title}")
        sizes.append((np.ptp(touched - free), np.ptp(free)))
    for axes in panels[:-1].ravel():
        axes.set_xlabel("")
    for axes in panels[:, 1:].ravel():
        axes.set_ylabel("")
    return ReportFigure("equipotentials", figure, _line_caption(patterns, sizes),
                        {"equipotentials": pd.DataFrame(data)})


def _potential(skin: SkinMap, name: str, pattern: int) -> Array:
    return next(values for key, values in skin.fields.items()
                if key.rsplit("_", 1)[0] == name and int(key.rsplit("_", 1)[1]) == pattern)


def _levels(triangles: Triangulation, values: Array) -> Array:
    """Levels that part the disc in equal areas, each once; two about zero where all values are the same."""
    corners = triangles.triangles
    x, y = triangles.x[corners], triangles.y[corners]
    area = np.abs((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0]))
    middle = values[corners].mean(axis=1)
    order = np.argsort(middle)
    below = np.cumsum(area[order]) / area.sum()
    found = np.unique(np.interp(np.linspace(0, 1, _LINES + 2)[1:-1], below, middle[order]))
    return found if np.ptp(found) > 0 else np.array([-1.0, 1.0])


def _disc(axes: Axes, scene: Mapping[str, Any]) -> None:
    axes.grid(False)
    sensor(axes, scene["body"], scene["electrodes"])
    for punch in scene["punch"]:
        angle = np.linspace(0, 2 * np.pi, 97)
        axes.plot(punch["x_mm"] + punch["diameter_mm"] / 2 * np.cos(angle),
                  punch["y_mm"] + punch["diameter_mm"] / 2 * np.sin(angle), color=style.INK, lw=0.5)


def _line_caption(patterns: Sequence[int], sizes: Sequence[tuple[float, float]]) -> str:
    words = []
    for k, (change, span) in zip(patterns, sizes, strict=True):
        factor, unit = volts(np.array([change]))
        whole, whole_unit = volts(np.array([span]))
        words.append(f"{number(change * factor)} {unit} of {number(span * whole)} {whole_unit} in pattern {k}")
    return (f"Lines of equal potential, {_LINES} in each panel, between equal areas, dashed below zero; the levels are "
            "the same untouched and touched. The largest voltage between two places of the skin, that of the change "
            f"and that of the untouched skin: {', '.join(words)}. The lines of the change alone (right) part around "
            "the punch.")


def response(skin: SkinMap, scene: Mapping[str, Any]) -> ReportFigure:
    """Contact pressure, largest in-plane principal strain and vertical displacement (paper, figure 11)."""
    maps = {"pressure_kPa": ("Contact pressure (kPa)", skin.fields["contact_pressure_Pa"] / 1e3),
            "strain": ("Largest in-plane strain (–)", skin.fields["largest_in_plane_strain"]),
            "depth_mm": ("Displacement downwards (mm)", -skin.fields["displacement_m"][:, 2] * 1e3)}
    figure = style.sheet(56)
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    box = _about(scene)
    near = (np.abs(skin.triangles.x - box[0]) < box[2]) & (np.abs(skin.triangles.y - box[1]) < box[2])
    for axes, (title, values) in zip(panels, maps.values(), strict=True):
        _map(figure, axes, skin.triangles, values, title, float(values[near].max()))
        axes.set_xlim(box[0] - box[2], box[0] + box[2])
        axes.set_ylim(box[1] - box[2], box[1] + box[2])
    panels[0].set_ylabel("y (mm)")
    data = {"x_mm": skin.triangles.x, "y_mm": skin.triangles.y} | {name: values for name, (_, values) in maps.items()}
    return ReportFigure("response", figure, _response_caption(skin, {name: v for name, (_, v) in maps.items()}, scene),
                        {"response": pd.DataFrame(data)})


def _map(figure: Figure, axes: Axes, triangles: Triangulation, values: Array, title: str, top: float) -> None:
    axes.grid(False)
    drawn = axes.tripcolor(triangles, values, shading="gouraud", cmap=style.SEQUENTIAL, vmin=0.0, vmax=top or 1.0,
                           rasterized=True)
    axes.set_aspect("equal")
    style.label(axes, "x (mm)", "")
    bar = figure.colorbar(drawn, ax=axes, location="top", label=title)
    bar.outline.set_linewidth(0.4)  # pyright: ignore


def _about(scene: Mapping[str, Any]) -> tuple[float, float, float]:
    """Middle and half width, mm, of a square about the punches."""
    radius = max(punch["diameter_mm"] for punch in scene["punch"]) / 2
    ends = np.array([[punch["x_mm"], punch["y_mm"]] for punch in scene["punch"]])
    middle, spread = (ends.max(axis=0) + ends.min(axis=0)) / 2, np.ptp(ends, axis=0).max() / 2
    return float(middle[0]), float(middle[1]), float(spread + _ABOUT * radius)


def _response_caption(skin: SkinMap, maps: Mapping[str, Array], scene: Mapping[str, Any]) -> str:
    places = []
    for name in maps:
        k = int(np.argmax(maps[name]))
        x, y = skin.triangles.x[k], skin.triangles.y[k]
        places.append(min(float(np.hypot(x - p["x_mm"], y - p["y_mm"])) for p in scene["punch"]))
    pressure, strain, depth = (float(values.max()) for values in maps.values())
    return (f"The touch as a map: contact pressure up to {number(pressure)} kPa, {number(places[0])} mm from the axis "
            f"of its punch; largest in-plane principal strain up to {number(strain)} at {number(places[1])} mm; "
            f"displacement up to {number(depth)} mm. Drawn on the untouched surface, at points of its mesh, between "
            "which the peak of the profile may lie.")
