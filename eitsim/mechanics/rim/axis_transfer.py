"""Displacements as Fourier series about one axis, seen at points about another.

On half a turn both frames count the angle from the direction to the other axis, so that the second is a mirror image of
the first moved along the line through both; on a whole one both count from the x axis. Between the nodes of the
meridian's mesh stand cubics through the four nearest nodes of each line: gradients of a mesh's own quadratic elements
jump between them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.harmonics.arcs import AngularQuadrature, harmonics_at
from eitsim.mechanics.harmonics.fourier_fields import Points, gradients
from touchcal.arrays import Array

Indices = NDArray[np.int64]

_CUBIC = 4


@dataclass(frozen=True, eq=False)
class AxisTransfer:
    """Points about one axis, as points about the other."""

    points: Points  # the same places in the other's meridian, each with a circle of its own of one angle
    turn: Array  # (points, 3, 3) takes vectors of the other's local frame (r, theta, z) to this one's

    def gradient(self, amplitude: Array) -> Array:
        """Displacement gradients (points, 9) in this local frame of the other's amplitudes (nodes, 3, harmonics)."""
        seen = gradients(self.points, amplitude)[..., 0].reshape(-1, 3, 3)
        return (self.turn @ seen @ np.swapaxes(self.turn, 1, 2)).reshape(-1, 9)

    def displacement(self, amplitude: Array) -> Array:
        """Displacements (points, 3) in this local frame of the other's amplitudes; none outside its mesh."""
        outside = ~self.points.shape.any(axis=(1, 2))
        radius = 1 / np.where(outside, 1.0, self.points.shape[..., 2].sum(axis=1))
        at = np.einsum("na,nacm->ncm", self.points.shape[..., 2] * radius[:, None], amplitude[self.points.nodes])
        even, odd = (np.einsum("ncm,nm->nc", at, table[..., 0])
                     for table in (self.points.circles.cosine, self.points.circles.sine))
        even[:, 1] = odd[:, 1]
        return np.einsum("nij,nj->ni", self.turn, even)


def view(columns: Array, rows: Array, harmonics: int, separation: float, radius: Array, angle: Array,
         height: Array) -> AxisTransfer:
    """Points (n,) at radius, angle and height about an axis seen from one at a distance `separation`, whose mesh of the
    meridian has these columns and rows of nodes, and whose series so many harmonics of half a turn."""
    x, y = separation - radius * np.cos(angle), radius * np.sin(angle)
    around = np.arctan2(y, x)
    return _transfer(columns, rows, harmonics, np.hypot(x, y), around, height, angle + around, mirrored=True)


def view_all_around(columns: Array, rows: Array, harmonics: int, other: Array, radius: Array, angle: Array,
                    height: Array) -> AxisTransfer:
    """As `view`, from an axis at x and y (2,) from this one, by harmonics of a whole turn."""
    x, y = radius * np.cos(angle) - other[0], radius * np.sin(angle) - other[1]
    around = np.arctan2(y, x)
    return _transfer(columns, rows, harmonics, np.hypot(x, y), around, height, around - angle, mirrored=False)


def _transfer(columns: Array, rows: Array, harmonics: int, away: Array, around: Array, height: Array, turned: Array, *,
              mirrored: bool) -> AxisTransfer:
    """Points (n,) at radii `away`, angles `around` and heights in the other's frame, whose local one is turned by
    angles, or mirrored and turned, from this one's."""
    column, across, slope = cubics(columns, np.minimum(away, columns[-1]))
    row, up, rise = cubics(rows, height)
    shape = np.stack([slope[:, :, None] * up[:, None], across[:, :, None] * rise[:, None],
                      across[:, :, None] * up[:, None] / away[:, None, None]], axis=-1)
    shape = np.where(away > columns[-1], 0.0, 1.0)[:, None, None, None] * shape
    steps = np.arange(_CUBIC)
    nodes = (column[:, None] + steps)[:, :, None] * len(rows) + (row[:, None] + steps)[:, None]
    circles = AngularQuadrature(np.ones((len(away), 1)), *harmonics_at(around[:, None], harmonics, not mirrored),
                                not mirrored)
    cosine, sine, none = np.cos(turned), np.sin(turned), np.zeros_like(turned)
    first = -1 if mirrored else 1
    turn = np.array([[first * cosine, -first * sine, none], [sine, cosine, none], [none, none, none + 1]])
    return AxisTransfer(Points(np.ascontiguousarray(shape.reshape(len(away), -1, 3)),
                        np.ascontiguousarray(nodes.reshape(len(away), -1)), np.arange(len(away)), circles),
                 np.ascontiguousarray(np.moveaxis(turn, 2, 0)))


def cubics(line: Array, points: Array) -> tuple[Indices, Array, Array]:
    """First of the four nodes (n,) of a line about each of n points, the cubics (n, 4) through them, their slopes."""
    first = np.clip(np.searchsorted(line, points) - _CUBIC // 2, 0, len(line) - _CUBIC)
    nodes = line[first[:, None] + np.arange(_CUBIC)]
    value, slope = np.ones(nodes.shape), np.zeros(nodes.shape)
    for k in range(_CUBIC):
        for j in range(_CUBIC):
            if j != k:
                width = nodes[:, k] - nodes[:, j]
                slope[:, k] = (slope[:, k] * (points - nodes[:, j]) + value[:, k]) / width
                value[:, k] = value[:, k] * (points - nodes[:, j]) / width
    return first, value, slope
