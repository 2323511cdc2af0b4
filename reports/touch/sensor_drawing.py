"""The skin and the electrodes of a sensor from above, to scale."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from eitsim.scene.edges.edge import Edge
from eitsim.scene.edges.outline_electrodes import patch_loops
from eitsim.scene.scene import Scene
from reports.document import style

_NUMBER, _MARGIN = 0.05, 0.1  # Distance of a number from the edge, and room around all, over the skin's size.


def draw_sensor(axes: Axes, scene: Scene) -> None:
    """Skin, holes and electrodes, electrode numbers from 0; missing ones in grey."""
    edge, electrodes = scene.body.edge, scene.electrodes
    draw_skin(axes, edge)
    colours = [style.GREY if k in electrodes.missing else style.INK for k in range(electrodes.count)]
    if patches := [patch * 1e3 for patch in patch_loops(electrodes)]:
        for patch, colour in zip(patches, colours, strict=True):
            axes.add_patch(Polygon(patch, facecolor=colour, edgecolor="none"))
        places = np.array([patch.mean(axis=0) for patch in patches]) - [0.0, _NUMBER * _size_mm(edge)]
    else:
        ends = edge.stretches_m(electrodes)
        for (first, last), colour in zip(ends.tolist(), colours, strict=True):
            axes.plot(*(1e3 * edge.path_m(first, last)).T, solid_capstyle="butt", lw=2.2, color=colour)
        places = 1e3 * edge.along_m(ends.mean(axis=1)) + _NUMBER * _size_mm(edge) * edge.outwards(ends)
    for k, (x, y) in enumerate(places):
        axes.text(x, y, str(k), ha="center", va="center", fontsize=7)


def draw_skin(axes: Axes, edge: Edge) -> None:
    """Skin and holes, mm."""
    for loop, colour in zip(edge.loops, ["#f7f7f7", *["white"] * len(edge.loops[1:])], strict=True):
        axes.add_patch(Polygon(1e3 * loop, facecolor=colour, edgecolor=style.GREY, lw=0.6))
    low, high = (1e3 * corner for corner in edge.box_m)
    room = _MARGIN * _size_mm(edge)
    axes.set_aspect("equal")
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)
    style.label(axes, "x (mm)", "y (mm)")


def _size_mm(edge: Edge) -> float:
    """The larger of the extents along x and y."""
    low, high = edge.box_m
    return 1e3 * float((high - low).max())
