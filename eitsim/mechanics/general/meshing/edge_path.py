"""A closed edge of the skin cut into pieces: as short as asked, with middles on the edge and corners kept.

A polygon of many short sides that stands for a curve is cut by its length, so that pieces span several of its sides.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.general.meshing.graded_triangles import Size, cross
from touchcal.arrays import Array

# Turn of the edge from which a corner is one, rad, and the largest turn within a piece.
_CORNER, _TURN = np.deg2rad(25.0), np.deg2rad(45.0)
_SAME = 1e-6  # Ends closer than this are one.
_NONE = np.empty(0)


@dataclass(frozen=True, eq=False)
class EdgePath:
    """A polygon by its length, closed or from one end to another."""

    corners: Array  # (n + 1, 2) corners, of a closed one the first again at the end
    arc: Array  # (n + 1,) length up to each
    closed: bool = True

    def at(self, arc: Array) -> Array:
        """Points (..., 2) at arc lengths (...)."""
        along = np.mod(arc, self.arc[-1]) if self.closed else arc
        return np.stack([np.interp(along, self.arc, x) for x in self.corners.T], axis=-1)


def edge_path(loop: Array) -> EdgePath:
    """The path of a closed polygon (n, 2)."""
    corners = np.vstack([loop, loop[:1]])
    return EdgePath(corners, np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))))


def open_path(corners: Array) -> EdgePath:
    """The path along corners (n, 2), from the first to the last."""
    return EdgePath(corners, np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))), closed=False)


def pieces(path: EdgePath, size: Size, ends: Array = _NONE) -> Array:
    """Arc lengths (m + 1,) of the ends of the pieces, the first one again at the end plus the whole length: corners
    and given ends (n,), and between them pieces no longer than the size at their places, that turn by _TURN at most."""
    side = np.diff(path.corners, axis=0)
    before = np.roll(side, 1, axis=0)
    turn = np.abs(np.arctan2(cross(before, side), np.sum(before * side, axis=1)))
    sharp = np.flatnonzero(turn > _CORNER) if path.closed else np.union1d(0, np.flatnonzero(turn > _CORNER))
    start = np.unique(np.append(path.arc[sharp], np.mod(ends, path.arc[-1])))
    start = start[np.append(True, np.diff(start) > _SAME)] if len(start) else path.arc[:1]
    stops = np.append(start, start[0] + path.arc[-1])
    out = [stops[:1]]
    for a, b in itertools.pairwise(stops):
        s = np.linspace(a, b, max(65, 4 * int(np.ceil((b - a) / size(path.at(np.linspace(a, b, 65))).min()))))
        middle = (s[1:] + s[:-1]) / 2
        steps = np.diff(s) / size(path.at(middle))
        steps += np.diff(_turned(path, turn, s, np.isin(np.arange(len(turn)), sharp))) / _TURN
        way = np.append(0.0, np.cumsum(steps))
        count = max(int(np.ceil(way[-1] - 1e-9)), 1 if len(start) > 1 else 3)
        out.append(np.append(np.interp(np.linspace(0, way[-1], count + 1)[1:-1], way, s), b))
    return np.concatenate(out)


def _turned(path: EdgePath, turn: Array, arc: Array, sharp: NDArray[np.bool_]) -> Array:
    """The smooth corners' turn up to arc lengths, each spread over the halves of its two sides."""
    length = np.diff(path.arc)
    smooth = np.where(sharp, 0.0, turn)
    whole = np.append(0.0, np.cumsum((smooth + np.roll(smooth, -1)) / 2))
    lap, along = np.divmod(arc, path.arc[-1])
    return lap * whole[-1] + np.interp(along, path.arc, whole) if length.size else np.zeros_like(arc)
