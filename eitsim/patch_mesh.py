"""Half of a round patch of the foam about a punch, clipped by the disc's rim: an O-grid of curved 27-node hexahedra."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex, MeshHex2

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Radius of the core over that where the fillet starts, and how far its square lies from the circle at the axis.
_CORE, _CORE_SQUARE = 0.6, 0.75
# Part of the rays that end on the rim.
_RIM_RAYS = 0.4
# Width over which the rings outside the punch grow, thicknesses and per unit of their span.
_FIRST_RING = 0.05


@dataclass(frozen=True)
class Outline:
    """Shape of a patch; lengths in any one unit, the punch's axis at the origin, the nearest rim point on +x."""

    # radius of the disc
    disc: float
    # distance of the punch's axis from the disc's centre
    offset: float
    # radius of the punch and of its fillet
    punch: float
    fillet: float
    # radius of the patch
    reach: float

    def rim(self, angle: Array) -> Array:
        """Distance from the axis to the disc's rim in a direction."""
        return np.sqrt(self.disc**2 - (self.offset * np.sin(angle)) ** 2) - self.offset * np.cos(angle)

    @property
    def corner(self) -> float:
        """Angle at which the patch's circle meets the rim; any angle where it does not."""
        space = self.disc**2 - self.offset**2 - self.reach**2
        if space >= 2 * self.offset * self.reach:
            return _RIM_RAYS * math.pi
        return math.acos(space / (2 * self.offset * self.reach))


@dataclass(frozen=True)
class Fineness:
    """Numbers of elements."""

    # cells from the axis to the side of the core; half a turn has 4 times as many
    core: int = 2
    # rings between the core and the fillet, across the fillet, and from the punch's edge outwards
    inner: int = 1
    edge: int = 1
    outer: int = 5
    # heights of the layers' bounds over the thickness, from the bottom to the top
    layers: tuple[float, ...] = (-1.0, -0.4, 0.0)


def patch_mesh(outline: Outline, fine: Fineness) -> MeshHex2:
    """The mesh: concentric half squares of an even lattice, moved onto circles and the clipped outline."""
    flat, quads = _lattice(fine)
    count, bounds = len(flat), np.arange(len(fine.layers))
    points = np.vstack([np.column_stack([flat, np.full(count, k)]) for k in bounds])
    # corners of a hexahedron in scikit-fem's order: (0,0,0) (0,0,1) (0,1,0) (1,0,0) (0,1,1) (1,0,1) (1,1,0) (1,1,1)
    order = [(0, 0), (0, 1), (3, 0), (1, 0), (3, 1), (1, 1), (2, 0), (2, 1)]
    cells = np.hstack([np.stack([quads[:, c] + (k + up) * count for c, up in order]) for k in bounds[:-1]])
    mesh = MeshHex2.from_mesh(MeshHex(points.T.astype(float), cells))
    x, y = moved(mesh.doflocs[0], mesh.doflocs[1], outline, fine)
    z = np.interp(mesh.doflocs[2], bounds, fine.layers)
    return MeshHex2(np.stack([x, y, z]), mesh.t)


def _lattice(fine: Fineness) -> tuple[Array, Indices]:
    """Vertices (n, 2) of the logical half square and quadrilaterals (m, 4), counter-clockwise."""
    m, rings = fine.core, fine.inner + fine.edge + fine.outer
    grid = np.array([(i, j) for j in range(m + 1) for i in range(-m, m + 1)], dtype=float)
    quads = [(j * (2 * m + 1) + i, j * (2 * m + 1) + i + 1, (j + 1) * (2 * m + 1) + i + 1, (j + 1) * (2 * m + 1) + i)
             for j in range(m) for i in range(2 * m)]
    side = np.array([(m, j) for j in range(m)] + [(i, m) for i in range(m, -m, -1)] + [(-m, j) for j in
                    range(m, -1, -1)], dtype=float)
    first = [int(np.flatnonzero((grid == p).all(axis=1))[0]) for p in side]
    vertices, last = [grid], np.array(first)
    for k in range(1, rings + 1):
        vertices.append(side * (m + k) / m)
        new = len(grid) + (k - 1) * len(side) + np.arange(len(side))
        quads += [(last[j], new[j], new[j + 1], last[j + 1]) for j in range(len(side) - 1)]
        last = new
    return np.vstack(vertices), np.array(quads)


def moved(x: Array, y: Array, outline: Outline, fine: Fineness) -> tuple[Array, Array]:
    """Where points of the logical half square lie in the patch: rings at equal maximum norms, rays from the axis."""
    core, level = _core_radius(outline), np.maximum(np.abs(x), y)
    safe = np.where(level > 0, level, 1.0)
    u, v = x / safe, y / safe
    around = fine.core * np.where(u >= 1 - 1e-12, v, np.where(u <= -1 + 1e-12, 4 - v, 2 - u))
    angle = _angles(around, outline, fine)
    spoke, share = np.stack([np.cos(angle), np.sin(angle)]), np.minimum(level / fine.core, 1.0)
    square = _CORE_SQUARE * core / fine.core * np.stack([x, y])
    disc = (1 - share) * square + share * share * core * spoke
    first, second = np.where(level < fine.core, disc, _radii(level - fine.core, angle, outline, fine) * spoke)
    return first, second


def _core_radius(outline: Outline) -> float:
    return _CORE * (outline.punch - outline.fillet)


def _angles(around: Array, outline: Outline, fine: Fineness) -> Array:
    """Angle of a ray; one of the rays meets the corner of the patch's circle and the rim."""
    count = 4 * fine.core
    return np.interp(around, [0, round(_RIM_RAYS * count), count], [0.0, outline.corner, np.pi])


def _radii(ring: Array, angle: Array, outline: Outline, fine: Fineness) -> Array:
    """Radius at a ring number that counts from the core's side."""
    inner, edge = fine.inner, fine.inner + fine.edge
    circles = np.interp(ring, [0, inner, edge], [_core_radius(outline), outline.punch - outline.fillet, outline.punch])
    stop = np.minimum(outline.rim(angle), outline.reach)
    span, way = stop - outline.punch, np.clip((ring - edge) / fine.outer, 0, 1)
    growth = np.log(np.maximum(span / (_FIRST_RING * (1 + span)), 2.0))
    return np.where(ring <= edge, circles, outline.punch + span * np.expm1(growth * way) / np.expm1(growth))
