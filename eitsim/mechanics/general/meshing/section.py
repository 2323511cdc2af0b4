"""The graded section about a punch: sizes of its elements, where the contact ends, and its triangles.

Lengths in foam thicknesses; the foam fills heights -1 to 0.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.general.meshing.graded_triangles import filled, quadratic
from eitsim.mechanics.solid.grid import spread
from touchcal.arrays import Array

Indices = NDArray[np.int64]

_TIP = 1 / 4  # Size of elements at a tip, whose pressure is highest, over that at the end of the contact.

@dataclass(frozen=True)
class Grading:
    """Sizes of elements."""

    finest: float  # at the end of the contact, thicknesses
    growth: float  # per unit of distance from there
    widest: float = 0.7  # thicknesses
    tallest: float = 0.45  # thicknesses
    sectors: int = 12  # about a punch, at least


@dataclass(frozen=True)
class Zone:
    """Where the contact of a punch needs fine elements, by reference radii."""

    start: float  # from here
    end: float  # to here
    radius: float  # the punch's
    tip: bool = False  # and finer ones at the axis

    def away(self, r: Array, z: Array) -> Array:
        """Distance (...) of places from there."""
        return np.hypot(np.maximum(np.maximum(self.start - r, r - self.end), 0.0), z)


def size(grading: Grading, zone: Zone, r: Array, z: Array) -> Array:
    """Size (...) of elements at places of the section."""
    out = np.minimum(grading.finest + grading.growth * zone.away(r, z), grading.widest)
    return np.minimum(out, _TIP * grading.finest + grading.growth * np.hypot(r, z)) if zone.tip else out


def heights(grading: Grading, zone: Zone, r: float) -> Array:
    """Heights (n,), from -1 to 0, of layers at a radius."""
    def width(z: Array) -> Array:
        return np.minimum(size(grading, zone, np.full_like(z, r), z), grading.tallest)

    return np.concatenate([[-1.0], spread(-1.0, 0.0, width)])


def core_radius(grading: Grading, zone: Zone) -> float:
    """Radius inside which a fan of triangles stands: as wide as the elements at its edge."""
    r = np.linspace(0, zone.end, 401)[1:]
    wide = r <= 1.2 * size(grading, zone, r, np.zeros_like(r))
    return float(r[wide][-1]) if wide.any() else float(r[0])


@dataclass(frozen=True, eq=False)
class Section:
    """Quadratic triangles of the half-plane between two radii."""

    nodes: Array  # (n, 2) r and z
    cells: Indices  # (t, 6) clockwise, so that revolving them counter-clockwise gives a right-handed wedge
    inner: Array  # (levels,) heights of its nodes at the inner radius
    core: float  # the inner radius


def section(grading: Grading, zone: Zone, outer: float, outer_heights: Array) -> Section:
    """The section from the core to the radius `outer`, where it has the given heights."""
    core = core_radius(grading, zone)
    inner_heights = heights(grading, zone, core)
    stops = sorted({core, outer, *(r for r in (zone.start, zone.end) if core * 1.05 < r < outer * 0.995)})

    def across(z: float) -> Array:
        parts = [spread(a, b, lambda r: size(grading, zone, r, np.full_like(r, z)))
                 for a, b in itertools.pairwise(stops if z == 0 else [core, outer])]
        return np.concatenate([[core], *parts])

    top, bottom = across(0.0), across(-1.0)
    given = np.vstack([np.column_stack([top, np.zeros_like(top)]), np.column_stack([bottom, -np.ones_like(bottom)]),
                       np.column_stack([np.full(len(inner_heights) - 2, core), inner_heights[1:-1]]),
                       np.column_stack([np.full(len(outer_heights) - 2, outer), outer_heights[1:-1]])])
    points, cells = filled(given, lambda p: size(grading, zone, p[:, 0], p[:, 1]),
                           lambda p: (p[:, 0] > core) & (p[:, 0] < outer) & (p[:, 1] > -1) & (p[:, 1] < 0),
                           (np.array([core, -1.0]), np.array([outer, 0.0])))
    nodes, cells, _ = quadratic(points, cells[:, [0, 2, 1]])
    return Section(nodes, cells, halved(inner_heights), core)


def halved(levels: Array) -> Array:
    """Levels (2n - 1,) with the middles between them."""
    out = np.empty(2 * len(levels) - 1)
    out[::2], out[1::2] = levels, (levels[1:] + levels[:-1]) / 2
    return out
