"""Pictures of a curved body in three dimensions: its electrodes and punches, and what a touch makes of its skin."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from eitsim.scene.curved.curved_scene import CurvedScene, curved_scene
from reports.document import style
from reports.document.numerals import number
from reports.document.page import ReportFigure
from touchcal.arrays import Array

_HIDDEN = 0.35  # Cosine from which on triangles face away from the first punch too much to be seen.
_TURN, _RISE = 25.0, 12.0  # Angles, deg, from the first punch's axis at which the body is seen.


def body(tables: Mapping[str, Any], folder: Path) -> ReportFigure:
    """The body with numbered electrodes and its punches, to scale; `tables` as in a scene file, whose
    surface may be a file in the folder. InputFileError where that is not there."""
    scene = curved_scene(tables, folder)
    figure = style.sheet(74, 80)
    axes = _axes(figure, 111, scene)
    mesh = scene.body.triangles
    corners = 1e3 * mesh.nodes_m[mesh.cells[:, :3]]
    _draw(axes, scene, corners, np.tile([0.88, 0.88, 0.88, 1.0], (len(corners), 1)))
    seen = _towards(scene)
    places = 1e3 * np.array(scene.sheet(1.0).places_m).reshape(-1, 3)
    normals = scene.body.surface.nearest(places / 1e3)[1] if len(places) else places
    for k, (place, normal) in enumerate(zip(places, normals, strict=True)):
        if normal @ seen > 0:
            x, y, z = place + 2 * normal
            axes.text(x, y, z, str(k), fontsize=6, ha="center", va="center", color=style.INK, zorder=2)
    at, out = scene.body.surface.nearest(scene.places_m)
    for place, normal, punch in zip(1e3 * at, out, scene.punches, strict=True):
        axes.add_collection3d(Poly3DCollection([_disc(place, normal, 5e2 * punch.diameter_m)], facecolor=style.ACCENT,
                                               alpha=0.85, zorder=1))
    thick = number(tables["body"]["thickness_mm"])
    caption = (f"The body to scale: {_kind(tables['body'])}, its layer {thick} mm thick on a rigid core, with "
               f"{scene.sheet(1.0).count} electrodes and {_punches(tables['punch'])}.")
    return ReportFigure("scene", figure, caption, {"scene": pd.DataFrame([
        {key: value for key, value in punch.items() if key != "at_mm"} | dict(zip(
            ("x_mm", "y_mm", "z_mm"), punch["at_mm"], strict=True)) for punch in tables["punch"]])})


def response(file: Path, tables: Mapping[str, Any]) -> ReportFigure:
    """Displacement and conductance of the touched skin, from the file of `eitsim run --skin`."""
    scene, mesh = curved_scene(tables, file.parent), meshio.vtu.read(file)
    corners = 1e3 * mesh.points[mesh.cells[0].data[:, :3]]
    moved = 1e3 * np.linalg.norm(mesh.point_data["displacement_m"], axis=1).reshape(-1, 6).mean(axis=1)
    tensor = np.asarray(mesh.point_data["sheet_conductance_S"]).reshape(-1, 3, 3)
    conductance = (np.trace(tensor, axis1=1, axis2=2) / 2).reshape(-1, 6).mean(axis=1)
    ratio = conductance / np.median(conductance)
    figure = style.sheet(74)
    for place, values, title, colours, norm in (
            (121, moved, "Displacement (mm)", style.SEQUENTIAL, Normalize(0, max(moved.max(), 1e-9))),
            (122, ratio, "Sheet conductance over that at rest (–)", style.DIVERGING,
             Normalize(1 - np.abs(ratio - 1).max(), 1 + np.abs(ratio - 1).max() + 1e-12))):
        axes = _axes(figure, place, scene)
        _draw(axes, scene, corners, colormaps[colours](norm(values)))
        bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes, location="top", shrink=0.7, label=title)
        bar.outline.set_linewidth(0.4)  # pyright: ignore
    caption = (f"The touched skin on the untouched body, averages over triangles: displacement up to "
               f"{number(float(moved.max()))} mm (left), and half the trace of the sheet conductance from "
               f"{number(float(ratio.min()))} to {number(float(ratio.max()))} times that at rest (right).")
    middle = corners.mean(axis=1)
    return ReportFigure("response", figure, caption, {"response": pd.DataFrame({
        "x_mm": middle[:, 0], "y_mm": middle[:, 1], "z_mm": middle[:, 2], "displacement_mm": moved,
        "conductance_ratio": ratio})})


def _axes(figure: Figure, place: int, scene: CurvedScene) -> Axes3D:
    """Axes without a frame, seen from near the first punch's axis, to scale."""
    axes = figure.add_subplot(place, projection="3d")
    assert isinstance(axes, Axes3D), "a projection in three dimensions was asked for"
    seen = _towards(scene)
    axes.view_init(np.degrees(np.arcsin(seen[2])) - _RISE, np.degrees(np.arctan2(seen[1], seen[0])) - _TURN)
    nodes = 1e3 * scene.body.triangles.nodes_m
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(np.maximum(high - low, 1e-3 * np.max(high - low)))
    axes.set_axis_off()
    axes.computed_zorder = False
    return axes


def _towards(scene: CurvedScene) -> Array:
    """Outward normal (3,) under the first punch."""
    return scene.body.surface.nearest(scene.places_m[:1])[1][0]


def _draw(axes: Axes3D, scene: CurvedScene, corners_mm: Array, colours: Array) -> None:
    """Triangles (t, 3, 3) with colours (t, 4), those that face away left out."""
    normals = scene.body.surface.nearest(corners_mm.mean(axis=1) / 1e3)[1]
    front = normals @ _towards(scene) > -_HIDDEN
    axes.add_collection3d(Poly3DCollection(corners_mm[front], facecolors=colours[front], edgecolor=(0, 0, 0, 0.08),
                                           linewidth=0.1, rasterized=True, zorder=0))


def _disc(place: Array, normal: Array, radius: float) -> Array:
    """Corners (24, 3) of a disc just outside the body."""
    first = np.cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    angle = 2 * np.pi * np.arange(24) / 24
    ring = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * np.cross(normal, first)
    return place + 1.0 * normal + radius * ring


def _kind(table: Mapping[str, Any]) -> str:
    sizes = ", ".join(f"{key.removesuffix('_mm').replace('_', ' ')} {number(value)} mm" for key, value in table.items()
                      if key.endswith("_mm") and key not in ("thickness_mm", "unit_mm"))
    return f"{table['surface']}{f' ({sizes})' if sizes else ''}"


def _punches(punches: Sequence[Mapping[str, Any]]) -> str:
    placed = [f"{number(punch['diameter_mm'])} mm near ({', '.join(number(part) for part in punch['at_mm'])}) mm"
              for punch in punches]
    return f"the punch of {placed[0]}" if len(placed) == 1 else f"the punches of {' and '.join(placed)}"
