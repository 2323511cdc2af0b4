"""A flat skin with an outline as one looks at it from above: its edges and where its electrodes are."""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import patch_loops, stretches_along
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
    edges = tuple(1e3 * loop for loop in outline.loops)
    if not electrodes.along_edge:
        return SkinFromAbove(edges, tuple(1e3 * np.vstack([patch, patch[:1]]) for patch in patch_loops(electrodes)))
    return SkinFromAbove(edges, tuple(_stretch(edges[0], first, last)
                                      for first, last in (1e3 * stretches_along(outline, electrodes)).tolist()))


def skin_of_sheet(sheet: Sheet) -> SkinFromAbove:
    """The skin of a surrogate; electrodes on its surface are drawn as discs of their width."""
    breaks = np.flatnonzero(np.any(sheet.end_mm[:-1] != sheet.start_mm[1:], axis=1)) + 1
    edges = tuple(np.split(sheet.start_mm, breaks))
    half = sheet.electrode[:, 2] / 2
    if sheet.on_surface:
        turn = np.linspace(0, 2 * np.pi, _DISC + 1)
        round_ = half[:, None, None] * np.column_stack([np.cos(turn), np.sin(turn)])
        return SkinFromAbove(edges, tuple(sheet.electrode[:, None, :2] + round_))
    middle = _arc_at(edges[0], sheet.electrode[:, :2])
    return SkinFromAbove(edges, tuple(_stretch(edges[0], first, last) for first, last in
                                      np.column_stack([middle - half, middle + half]).tolist()))


def _arcs(loop: Array) -> Array:
    """Arc lengths (n + 1,) of the corners of a closed polygon (n, 2), the whole length last."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1))])


def _arc_at(loop: Array, places: Array) -> Array:
    """Arc lengths (k,) of the points of a closed polygon nearest to places (k, 2)."""
    along = np.roll(loop, -1, axis=0) - loop
    length = np.linalg.norm(along, axis=1)
    way = np.clip(np.sum((places[:, None] - loop) * along, axis=2) / length**2, 0, 1)
    off = np.linalg.norm(places[:, None] - loop - way[..., None] * along, axis=2)
    nearest = off.argmin(axis=1)
    return _arcs(loop)[nearest] + (way * length)[np.arange(len(places)), nearest]


def _stretch(loop: Array, first: float, last: float) -> Array:
    """Corners (n, 2) of a closed polygon's part between two arc lengths, ends included."""
    arcs = _arcs(loop)
    whole = arcs[-1]
    laps = np.concatenate([arcs[:-1] + lap * whole for lap in (-1, 0, 1)])
    at = np.concatenate([[first], laps[(laps > first) & (laps < last)], [last]])
    closed = np.vstack([loop, loop[:1]])
    return np.column_stack([np.interp(np.mod(at, whole), arcs, closed[:, k]) for k in (0, 1)])
