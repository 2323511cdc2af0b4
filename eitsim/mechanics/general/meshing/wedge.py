"""The wedge of 18 nodes: a quadratic triangle times a quadratic line, isoparametric.

Node i + 6 j is node i of the triangle, corners first, then the middles of the edges 01, 12 and 02, on level j of the
line. References are s, t >= 0, s + t <= 1 on the triangle and w in [-1, 1] along the line.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature_tri

from eitsim.mechanics.solid.grid import lagrange
from touchcal.arrays import Array

Indices = NDArray[np.int64]

NODES, TRIANGLE = 18, 6
# Points of the quadrature on the triangle (its degree) and along the line; fewer leave modes without stiffness.
_DEGREE, _ALONG = 4, 3


def shapes(at: Array) -> tuple[Array, Array]:
    """Shape functions (n, 18) and their derivatives (n, 18, 3) by s, t and w at references (n, 3)."""
    flat, slope = triangle_shapes(at[:, :2])
    line, along = lagrange(2, at[:, 2])
    value = (line[:, :, None] * flat[:, None]).reshape(len(at), NODES)
    by_plane = (line[:, :, None, None] * slope[:, None]).reshape(len(at), NODES, 2)
    by_line = (along[:, :, None] * flat[:, None]).reshape(len(at), NODES, 1)
    return value, np.concatenate([by_plane, by_line], axis=2)


def triangle_shapes(at: Array) -> tuple[Array, Array]:
    """Shape functions (n, 6) and their derivatives (n, 6, 2) of the quadratic triangle at references (n, 2)."""
    element = ElementTriP2()
    parts = [element.lbasis(at.T, i) for i in range(TRIANGLE)]
    return (np.stack([np.broadcast_to(value, len(at)) for value, _ in parts], axis=1),
            np.stack([np.broadcast_to(slope, (2, len(at))).T for _, slope in parts], axis=1))


@lru_cache(maxsize=1)
def gauss_points() -> tuple[Array, Array]:
    """References (q, 3) and weights (q,) of the quadrature over a wedge: 6 points times 3."""
    (flat, weight), (along, share) = get_quadrature_tri(_DEGREE), np.polynomial.legendre.leggauss(_ALONG)
    at = np.column_stack([np.tile(flat.T, (len(along), 1)), np.repeat(along, flat.shape[1])])
    return at, np.outer(share, weight).ravel()


@dataclass(frozen=True, eq=False)
class Facets:
    """Faces of wedges on the surface, all triangles of six nodes or all quadrilaterals of nine, with Gauss points."""

    element: Indices  # (f,) wedge of each
    local: Indices  # (f, k) its nodes in the wedge's numbers
    nodes: Indices  # (f, k) the same in the mesh's
    shape: Array  # (p, k) shape functions at the points
    # (f, 2, 2) references s, t of both ends of a quadrilateral's edge in the triangle; none of a triangle
    ends: Array
    weight: Array  # (f, p) reference areas of the points

    @property
    def quadrilateral(self) -> bool:
        return self.local.shape[1] == 9


def facet_references(quadrilateral: bool, ends: Array, at: Array) -> Array:
    """References (n, 3) in the wedge of places (n, 2) on its facet: s and t, or along the edge from -1 to 1 between
    ends (n, 2, 2) and along the line."""
    if not quadrilateral:
        return np.column_stack([at, np.ones(len(at))])
    share = (1 + at[:, :1]) / 2
    return np.column_stack([(1 - share) * ends[:, 0] + share * ends[:, 1], at[:, 1]])


def facet_shapes(quadrilateral: bool, at: Array) -> tuple[Array, Array]:
    """Shape functions (n, k) and derivatives (n, k, 2) of a facet at places (n, 2)."""
    if not quadrilateral:
        return triangle_shapes(at)
    (one, by_one), (other, by_other) = lagrange(2, at[:, 0]), lagrange(2, at[:, 1])
    # nodes run along the edge first, as its ends and then its middle
    order = [0, 2, 1]
    one, by_one = one[:, order], by_one[:, order]
    return ((other[:, :, None] * one[:, None]).reshape(len(at), 9), np.stack(
        [(other[:, :, None] * by_one[:, None]).reshape(len(at), 9),
         (by_other[:, :, None] * one[:, None]).reshape(len(at), 9)], axis=2))


@lru_cache(maxsize=2)
def facet_points(quadrilateral: bool) -> tuple[Array, Array]:
    """Places (p, 2) and weights (p,) of the contact's Gauss points on a facet: 4 times 4, or 12."""
    if not quadrilateral:
        at, weight = get_quadrature_tri(6)
        return at.T, weight
    t, w = np.polynomial.legendre.leggauss(4)
    return np.column_stack([np.tile(t, 4), np.repeat(t, 4)]), np.outer(w, w).ravel()


def facets(nodes_at: Array, elements: Indices, element: Indices, local: Indices, ends: Array) -> Facets:
    """Facets with the reference areas of their points; nodes_at (nodes, 3)."""
    quadrilateral = local.shape[1] == 9
    at, weight = facet_points(quadrilateral)
    shape, slope = facet_shapes(quadrilateral, at)
    nodes = elements[element[:, None], local]
    along = np.einsum("pkd,fki->fpdi", slope, nodes_at[nodes])
    area = np.linalg.norm(np.cross(along[:, :, 0], along[:, :, 1]), axis=-1)
    return Facets(element, local, nodes, shape, ends, area * weight)
