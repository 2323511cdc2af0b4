"""Tensor Q2 mesh of the foam's meridian half-plane, numbered for a narrow band."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementQuad1, ElementQuad2, MappingAffine, MeshQuad

from eitsim.scene import Body, Punch

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Gauss points per element and direction.
_POINTS = 3
# Distance over which elements double away from the fillet, sideways and downwards, in thicknesses, and the widest
# element under the punch.
_WIDENS, _DEEPENS, _WIDEST = 0.08, 0.2, 0.06


@dataclass(frozen=True)
class Grid:
    """A Q2 mesh of the (r, z) half-plane with its quadrature; lengths in any one unit."""

    # (nodes, 2) reference position (r, z), column after column, upwards in each
    nodes: Array
    # (elements, 9) node numbers
    elements: Indices
    # (nodes, 2) number of the unknown of (u_r, u_z); -1 where the displacement is zero
    unknown: Indices
    # (elements, points, 9, 3) N_,r, N_,z and N/r of each shape function; the last is 0 in plane strain
    gradient: Array
    # (elements, points) quadrature weight, 2 pi r included unless plane strain
    weight: Array
    # (facets, 3) nodes of the top facets from the axis outwards: inner, middle, outer
    top: Indices

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns."""
        return int(self.unknown.max()) + 1

    @property
    def bandwidth(self) -> int:
        """Largest distance between two unknowns of one element."""
        numbers = self.unknown[self.elements].reshape(len(self.elements), -1)
        return int((numbers.max(axis=1) - np.where(numbers < 0, numbers.max(), numbers).min(axis=1)).max())


def foam_grid(body: Body, punch: Punch, element_m: float) -> Grid:
    """Grid of a foam disc about the punch's axis, lengths over its thickness, bottom fixed.

    Lines lie at the edge of the punch and where its fillet starts. element_m is the element size there, m; elements
    widen with the distance from there, and all of them halve with it. ValueError unless 0 < element_m < thickness.
    """
    if not 0 < element_m < body.thickness_m:
        raise ValueError(f"element_m must lie between 0 and the thickness of {body.thickness_m} m, got {element_m}.")
    size, unit = element_m / body.thickness_m, body.thickness_m
    edge, fillet = punch.diameter_m / 2 / unit, punch.fillet_m / unit
    if edge >= body.radius_m / unit:
        raise ValueError(f"the punch (diameter {punch.diameter_m} m) must be smaller than the disc "
                         f"(radius {body.radius_m} m).")

    def width(r: Array) -> Array:
        away = np.maximum(edge - fillet - r, np.maximum(r - edge, 0))
        widest = np.where(r < edge, _WIDEST * size / 0.02, np.inf)
        return np.minimum(size * (1 + away / _WIDENS), widest)

    def height(z: Array) -> Array:
        return size * (1 + (1 - z) / _DEEPENS)

    stops = sorted({0.0, max(edge - fillet, 0.0), edge, body.radius_m / unit})
    r = np.concatenate([[0.0], *(spread(a, b, width) for a, b in zip(stops, stops[1:], strict=False))])
    z = np.concatenate([[0.0], spread(0.0, 1.0, height)])
    return tensor_grid(r, z)


def tensor_grid(r: Array, z: Array, *, plane: bool = False, free: bool = False) -> Grid:
    """Grid on lines r and z: bottom fixed and u_r = 0 at r = 0, or everything free; axisymmetric or plane strain."""
    mesh = MeshQuad.init_tensor(r, z)
    basis = Basis(mesh, ElementQuad2(), MappingAffine(mesh), intorder=2 * _POINTS - 1)
    order = np.lexsort(np.round(basis.doflocs[::-1], 12))
    number = np.empty_like(order)
    number[order] = np.arange(order.size)
    nodes = np.ascontiguousarray(basis.doflocs.T[order])
    fixed = np.zeros(nodes.shape, dtype=bool)
    if not free:
        fixed |= (nodes[:, 1] == z[0])[:, None]
        fixed[:, 0] |= nodes[:, 0] == 0
    unknown = np.where(fixed, -1, np.cumsum(~fixed.ravel()).reshape(nodes.shape) - 1)
    gradient, weight = _quadrature(basis, plane)
    surface = np.flatnonzero(nodes[:, 1] == z[-1])
    top = np.column_stack([surface[:-1:2], surface[1::2], surface[2::2]])
    return Grid(nodes, number[basis.element_dofs.T], unknown, gradient, weight, top)


def _quadrature(basis: Basis, plane: bool) -> tuple[Array, Array]:
    radius = basis.global_coordinates().value[0]
    gradient = np.zeros((*radius.shape, 9, 3))
    for k, (shape,) in enumerate(basis.basis):
        gradient[:, :, k, :2] = np.moveaxis(shape.grad, 0, -1)
        if not plane:
            gradient[:, :, k, 2] = shape.value / radius
    return gradient, basis.dx * (1.0 if plane else 2 * np.pi * radius)


def spread(start: float, stop: float, width: Callable[[Array], Array]) -> Array:
    """Points after start, up to stop, spaced in proportion to a width and at most as wide."""
    x = np.linspace(start, stop, 2001)
    steps = np.concatenate([[0.0], np.cumsum(np.diff(x) / width((x[1:] + x[:-1]) / 2))])
    count = max(math.ceil(steps[-1] - 1e-9), 1)
    inside = np.interp(np.linspace(0, steps[-1], count + 1)[1:-1], steps, x)
    return np.append(inside, stop)
