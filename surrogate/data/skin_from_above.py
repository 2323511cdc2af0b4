"""A flat skin with an outline as one looks at it from above: its edges and where its electrodes are."""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.edges.electrode_outlines import outlines_m
from eitsim.scene.edges.outline import Outline
from eitsim.scene.outline_edge import arcs_of, path_along
from eitsim.scene.polygons import Loops
from eitsim.scene.scene import Electrodes
from surrogate.data.outlined_sheet import Sheet
from touchcal.arrays import Array

_DISC = 24  # corners of a disc


@dataclass(frozen=True, eq=False)
class SkinFromAbove:
    """Closed edges and electrodes, mm."""

    loops_mm: tuple[Array, ...]  # corners (n, 2) of the outer edge, then of every hole; the last joins the first
    # corners (n, 2) of each electrode: along the outer edge, or about a patch, whose first corner is its last, too
    electrodes_mm: tuple[Array, ...]


def skin_of(outline: Outline, electrodes: Electrodes) -> SkinFromAbove:
    """A skin with an outline, and its electrodes of either kind."""
    return SkinFromAbove(tuple(1e3 * loop for loop in outline.loops),
                         tuple(1e3 * path for path in outlines_m(outline, electrodes)))


def skin_of_sheet(sheet: Sheet) -> SkinFromAbove:
    """The skin of a surrogate; electrodes on its surface are drawn as discs of their width."""
    breaks = np.flatnonzero(np.any(sheet.end_mm[:-1] != sheet.start_mm[1:], axis=1)) + 1
    edges = tuple(np.split(sheet.start_mm, breaks))
    half = sheet.electrode[:, 2] / 2
    if sheet.on_surface:
        turn = np.linspace(0, 2 * np.pi, _DISC + 1)
        round_ = half[:, None, None] * np.column_stack([np.cos(turn), np.sin(turn)])
        return SkinFromAbove(edges, tuple(sheet.electrode[:, None, :2] + round_))
    outline = Loops(edges)
    middle, _ = arcs_of(outline, sheet.electrode[:, :2])
    return SkinFromAbove(edges, tuple(path_along(outline, first, last) for first, last in
                                      np.column_stack([middle - half, middle + half]).tolist()))
