"""Which wedge a place of the surface lies on, and where on it."""

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
        away = points - one.circle.centre
        radius, sectors = np.hypot(*away.T), len(one.circle.angles) - 1
        angle = np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi)
        sector = np.clip(np.searchsorted(one.circle.angles, angle, side="right") - 1, 0, sectors - 1)
        within = left & (radius <= one.circle.radius)
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
        triangle, start, inside = np.empty(left.sum(), np.int64), np.empty((left.sum(), 2)), np.empty(left.sum())
        _find(np.ascontiguousarray(corners), points[left], triangle, start, inside)
        found, at = _on(mesh, mesh.flat, first_fan + triangle, start, points[left])
        element[left], reference[left] = np.where(inside > _OUTSIDE, found, -1), at
    return Places(points, element, reference)


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
