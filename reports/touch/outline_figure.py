"""The sensor from above where its skin has an outline."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from eitsim.scene.outline import loops
from eitsim.scene.outline_edge import edge_starts, places_along
from eitsim.scene.outline_electrodes import middles_m, patch_loops, stretches_along
from eitsim.scene.scene import Body, Scene
from reports.document import style
from touchcal.arrays import Array

_NUMBER, _MARGIN = 0.05, 0.1  # Distance of a number from the edge, and room around all, over the outline's size.


def outlined_sensor(axes: Axes, scene: Scene) -> None:
    """Outline, holes and electrodes from above, to scale, electrode numbers from 0; missing ones in grey."""
    body, electrodes = scene.body, scene.electrodes
    outlined_skin(axes, body)
    size, middles = size_mm(body), middles_m(body, electrodes) * 1e3
    colours = [style.GREY if k in electrodes.missing else style.INK for k in range(electrodes.count)]
    if electrodes.kind == "surface":
        for patch, colour in zip(patch_loops(electrodes), colours, strict=True):
            axes.add_patch(Polygon(patch * 1e3, facecolor=colour, edgecolor="none"))
        middles = middles - [0.0, _NUMBER * size]
    else:
        ends = stretches_along(body, electrodes)
        for (first, last), colour in zip(ends.tolist(), colours, strict=True):
            axes.plot(*edge_path_mm(body, first, last).T, solid_capstyle="butt", lw=2.2, color=colour)
        middles = middles + _NUMBER * size * outwards(body, ends)
    for k, (x, y) in enumerate(middles):
        axes.text(x, y, str(k), ha="center", va="center", fontsize=7)


def outlined_skin(axes: Axes, body: Body) -> None:
    """Outline and holes from above, to scale, mm."""
    outer, *holes = (loop * 1e3 for loop in loops(body))
    axes.add_patch(Polygon(outer, facecolor="#f7f7f7", edgecolor=style.GREY, lw=0.6))
    for hole in holes:
        axes.add_patch(Polygon(hole, facecolor="white", edgecolor=style.GREY, lw=0.6))
    low, high = outer.min(axis=0) - _MARGIN * size_mm(body), outer.max(axis=0) + _MARGIN * size_mm(body)
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    style.label(axes, "x (mm)", "y (mm)")


def size_mm(body: Body) -> float:
    """The larger of an outline's extents along x and y."""
    return float(np.ptp(loops(body)[0], axis=0).max()) * 1e3


def edge_path_mm(body: Body, first: float, last: float) -> Array:
    """(n, 2) the outer edge from one arc length to another, m."""
    corners = edge_starts(body)[None, :-1] + edge_starts(body)[-1] * np.array([[-1], [0], [1]])
    return places_along(body, np.sort([first, last, *corners[(corners > first) & (corners < last)]])) * 1e3


def outwards(body: Body, ends: Array) -> Array:
    """(N, 2) directions out of the skin at the middles of stretches (N, 2) of its edge."""
    step = 1e-3 * (ends[:, 1] - ends[:, 0])
    along = places_along(body, ends.mean(axis=1) + step) - places_along(body, ends.mean(axis=1) - step)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.column_stack([along[:, 1], -along[:, 0]])
