"""Which wedge a place of the layer lies in, or one of its surface on, and where there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.general.meshing.wedge import Facets, facet_references, facet_shapes
from eitsim.mechanics.general.meshing.wedge_mesh import Revolved, WedgeMesh
from touchcal.arrays import Array
from touchcal.jit import compiled

Indices = NDArray[np.int64]

_STEPS = 5  # Newton steps to a place on a curved facet.
# Least barycentric coordinate of a place that counts as on a triangle: edges of the skin bulge over their chords.
_OUTSIDE = -0.2


@dataclass(frozen=True, eq=False)
class Places:
    """Places of the surface."""

    points: Array  # (n, 2) by coordinates
    element: Indices  # (n,) wedge of each; -1 where the mesh has none
    reference: Array  # (n, 3) where it lies in the wedge


def places(mesh: WedgeMesh, points: Array) -> Places:
    """Wedges and references of points (n, 2) by their coordinates, thicknesses."""
    element, reference = np.full(len(points), -1), np.zeros((len(points), 3))
    left, first_quad, first_fan = np.ones(len(points), dtype=bool), 0, 0
    for one in mesh.about:
        radius, angle, sector = _about(one, points)
        sectors, within = len(one.circle.angles) - 1, left & (radius <= one.circle.radius)
        ring = within & (radius > one.section.core)
        if ring.any():
            facet, start = _on_rings(one, radius[ring], angle[ring], sector[ring])
            element[ring], reference[ring] = _on(mesh, mesh.around, first_quad + facet, start, points[ring])
        core = within & ~ring
        if core.any():
            facet = first_fan + sector[core]
            element[core], reference[core] = _on(mesh, mesh.flat, facet, np.full((core.sum(), 2), 1 / 3), points[core])
        left &= ~within
        first_quad, first_fan = first_quad + sectors * (len(one.radii) - 1), first_fan + sectors
    if left.any() and first_fan < len(mesh.flat.element):
        corners = mesh.coordinates[mesh.flat.nodes[first_fan:, :3]][..., :2]
        triangle, start, least = _nearest(corners, points[left])
        found, at = _on(mesh, mesh.flat, first_fan + triangle, start, points[left])
        element[left], reference[left] = np.where(least > _OUTSIDE, found, -1), at
    return Places(points, element, reference)


def inside(mesh: WedgeMesh, points: Array) -> tuple[Indices, Array]:
    """Wedges (n,), -1 where the mesh has none, and about the references (n, 3) of points (n, 3) of the layer by
    coordinates, thicknesses."""
    top = places(mesh, points[:, :2])
    element, reference, first = top.element.copy(), top.reference.copy(), 0
    outer = np.ones(len(points), dtype=bool)
    for one in mesh.about:
        radius, angle, sector = _about(one, points[:, :2])
        sectors, cells, within = len(one.circle.angles) - 1, one.section.cells, radius <= one.circle.radius
        ring = within & (radius > one.section.core)
        start, end = one.circle.angles[sector[ring]], one.circle.angles[sector[ring] + 1]
        cell, at, _ = _nearest(one.section.nodes[cells[:, :3]], np.column_stack([radius, points[:, 2]])[ring])
        element[ring] = first + sector[ring] * len(cells) + cell
        reference[ring] = np.column_stack([at, (2 * angle[ring] - start - end) / (end - start)])
        core, first = within & ~ring, first + sectors * (len(cells) + len(one.section.inner) // 2)
        below, reference[core, 2] = _below(one.section.inner[::2], points[core, 2])
        element[core] -= below * sectors
        outer &= ~within
    outer &= element >= 0
    below, reference[outer, 2] = _below(mesh.heights, points[outer, 2])
    element[outer] -= below * len(mesh.plan.cells)
    return element, reference


def _below(heights: Array, z: Array) -> tuple[Indices, Array]:
    """How many layers (n,) between heights lie over the one of heights z (n,), and where in that, from -1 to 1."""
    layer = np.clip(np.searchsorted(heights, z, side="right") - 1, 0, len(heights) - 2)
    low, high = heights[layer], heights[layer + 1]
    return len(heights) - 2 - layer, (2 * z - low - high) / (high - low)


def _about(one: Revolved, points: Array) -> tuple[Array, Array, Indices]:
    """Radii and angles (n,) of points (n, 2) about a punch, and the sectors in which they lie."""
    away = points - one.circle.centre
    angle = np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi)
    sector = np.searchsorted(one.circle.angles, angle, side="right") - 1
    return np.hypot(*away.T), angle, np.clip(sector, 0, len(one.circle.angles) - 2)


def _on_rings(one: Revolved, radius: Array, angle: Array, sector: Indices) -> tuple[Indices, Array]:
    """Facets of one punch's rings, and places on them by straight radii and angles."""
    ring = np.clip(np.searchsorted(one.radii, radius, side="right") - 1, 0, len(one.radii) - 2)
    inner, outer = one.radii[ring], one.radii[ring + 1]
    first, last = one.circle.angles[sector], one.circle.angles[sector + 1]
    start = np.column_stack([(2 * radius - inner - outer) / (outer - inner),
                             (2 * angle - first - last) / (last - first)])
    return sector * (len(one.radii) - 1) + ring, start


def _on(mesh: WedgeMesh, faces: Facets, facet: Indices, at: Array, points: Array) -> tuple[Indices, Array]:
    """Wedges (n,) and references (n, 3) of points on facets, by Newton's method from places on them."""
    corners = mesh.coordinates[faces.nodes[facet]][..., :2]
    for _ in range(_STEPS):
        value, slope = facet_shapes(faces.quadrilateral, at)
        missing = points - np.einsum("na,nai->ni", value, corners)
        jacobian = np.einsum("nad,nai->nid", slope, corners)
        at = at + np.linalg.solve(jacobian, missing[..., None])[..., 0]
    return faces.element[facet], facet_references(faces.quadrilateral, faces.ends[facet], at)


def _nearest(corners: Array, points: Array) -> tuple[Indices, Array, Array]:
    """As `_find`, of triangles (t, 3, 2) and points (n, 2)."""
    triangle, start, least = np.empty(len(points), np.int64), np.empty((len(points), 2)), np.empty(len(points))
    _find(np.ascontiguousarray(corners), points, triangle, start, least)
    return triangle, start, least


@compiled
def _find(corners, points, triangle, start, inside):
    """The triangle (n,) of each point, its references there, and its least barycentric coordinate: the largest of all.
    """
    for p in range(len(points)):
        best = -np.inf
        for t in range(len(corners)):
            a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
            x, y = points[p, 0] - a[0], points[p, 1] - a[1]
            area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
            one = (x * (c[1] - a[1]) - y * (c[0] - a[0])) / area
            other = (y * (b[0] - a[0]) - x * (b[1] - a[1])) / area
            least = min(one, other, 1 - one - other)
            if least > best:
                best, triangle[p], start[p, 0], start[p, 1] = least, t, one, other
                if best >= 0:
                    break
        inside[p] = best
