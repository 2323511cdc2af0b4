"""Tensor mesh of the foam's meridian half-plane, biquadratic or bilinear, numbered for a narrow band."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementQuad1, ElementQuad2, MeshQuad

from eitsim.scene.scene import Body, Punch, profile_of
from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Elements by their order; each has order + 1 Gauss points per direction.
ELEMENTS = {1: ElementQuad1, 2: ElementQuad2}
# Corners, middles of edges and centre among an element's nodes column after column, by order.
_AROUND = {1: [0, 2, 3, 1], 2: [0, 6, 8, 2, 3, 7, 5, 1, 4]}
# Sizes in feature lengths, where a feature is the fillet radius or, if less, a twentieth of the thickness: the default
# element at the edge of the punch, and the distances over which elements double from there, inwards, outwards and
# downwards. Inwards they stay fine longer, since the foam under the fillet comes from there.
_FEATURE, _ELEMENT, _INWARDS, _OUTWARDS, _DOWNWARDS = 0.05, 0.12, 1.2, 0.6, 0.6
# The same outwards from a sharp tip, towards which elements are as small as at the edge.
_FROM_TIP = 1.2
# Distance inside a flat punch's edge, thicknesses, from which deep touches draw the foam over the fillet, and the
# widest default element there, in feature lengths: wider ones catch on the fillet. With a fillet of 0.05 mm, 20 mm and
# 3 N on 10 mm of foam, what stands at the fillet comes from 0.11 within; elements of five fillets left 2 to 5 %. But by
# default at most so many elements there: with more, a touch takes more than 500 MB.
_DRAWN, _WIDEST_DRAWN, _MOST_DRAWN = 0.18, 0.5, 144
# Widest default element under the punch, in thicknesses; under a sharp tip the contact may end anywhere.
_WIDEST, _WIDEST_UNDER_TIP = 0.08, 0.03
# Where it is known at which radius the contact ends: feature lengths on either side over which elements stay small, the
# least number of default ones inside, where these are wider than at the end, and the distance over which they double
# outwards: with half of it, what a volume that conducts reads was found to 0.9 % in place of 0.1.
_AROUND_END, _INSIDE_END, _FROM_END = 0.5, 16, 1.2


@dataclass(frozen=True)
class Grid:
    """A mesh of the (r, z) half-plane with its quadrature, p the elements' order; lengths in any one unit."""

    nodes: Array  # (nodes, 2) reference position (r, z), column after column, upwards in each
    elements: Indices  # (elements, (p + 1)^2) node numbers
    unknown: Indices  # (nodes, 2) number of the unknown of (u_r, u_z); -1 where the displacement is zero
    # (elements, points, (p + 1)^2, 3) N_,r, N_,z and N/r of each shape function; the last is 0 in plane strain
    gradient: Array
    weight: Array  # (elements, points) quadrature weight, 2 pi r included unless plane strain
    top: Indices  # (facets, p + 1) nodes of the top facets, each from its inner to its outer end, outwards
    modes: Array  # (points, 1 or 3) in whose span the logarithm of an element's change of volume is projected
    # (nodes, 2) arc length and height of nodes that stand on a curved cap, column after column; None: as the nodes
    laid: Array | None = None
    curvature: float = 0.0  # of that cap's outer surface, positive where convex

    @property
    def flat_nodes(self) -> Array:
        """Nodes (nodes, 2) as the mesh was laid out flat."""
        return self.nodes if self.laid is None else self.laid

    @property
    def order(self) -> int:
        return self.top.shape[1] - 1

    @property
    def lines(self) -> tuple[Array, Array]:
        """Radii of the node columns and heights of the node rows, as laid out flat."""
        rows = int(self.top[0, 0]) + 1
        return self.flat_nodes[::rows, 0], self.flat_nodes[:rows, 1]

    @property
    def counter_clockwise(self) -> Indices:
        """Nodes (elements, (p + 1)^2): corners counter-clockwise, middles of the edges from the first on, centre."""
        return np.sort(self.elements, axis=1)[:, _AROUND[self.order]]

    @property
    def unknowns(self) -> int:
        return int(self.unknown.max()) + 1

    @cached_property
    def inner(self) -> Indices:
        """(elements, c) unknowns of the nodes inside elements, which no other element has; c is 2, or 0 of order 1."""
        return self.unknown[self.elements[:, 4 * self.order:]].reshape(len(self.elements), -1)

    @cached_property
    def outer(self) -> Indices:
        """All other unknowns, ascending."""
        return np.setdiff1d(np.arange(self.unknowns), self.inner)

    @cached_property
    def place(self) -> Indices:
        """(nodes, 2) place of each unknown among `outer`; -1 where the displacement is zero or inside an element."""
        place = np.full(self.unknowns + 1, -1)
        place[self.outer] = np.arange(len(self.outer))
        return place[self.unknown]

    @cached_property
    def bandwidth(self) -> int:
        """Largest distance between the places of two unknowns of one element."""
        numbers = self.numbers
        return int((numbers.max(axis=1) - np.where(numbers < 0, numbers.max(), numbers).min(axis=1)).max())

    @cached_property
    def slopes(self) -> Array:
        """(elements, points, 3, (p + 1)^2) of `gradient`, N_,r, N_,z and N/r of all nodes in a row."""
        return np.ascontiguousarray(np.swapaxes(self.gradient, 2, 3))

    @cached_property
    def dual(self) -> Array:
        """(elements, points, m): values at points (points,) give the coefficients of `modes` in their projection."""
        mass = np.einsum("eq,qm,qn->emn", self.weight, self.modes, self.modes)
        return (self.weight[..., None] * self.modes) @ np.linalg.inv(mass)

    @cached_property
    def numbers(self) -> Indices:
        """(elements, n) places of the unknowns of an element's outer nodes, all u_r before all u_z; -1 where the
        displacement is zero."""
        return np.swapaxes(self.place[self.elements[:, :4 * self.order]], 1, 2).reshape(len(self.elements), -1)


def feature_m(body: Body, punch: Punch) -> float:
    """Length that sets the element size, m: the fillet radius, at most a twentieth of the foam's thickness, or of
    its layer's on a soft base."""
    return min(punch.fillet_m, _FEATURE * body.layer_m)


def default_element_m(body: Body, punch: Punch) -> float:
    """Element size at the edge of the punch, m, that keeps depth and touch signal within half a percent."""
    return _ELEMENT * feature_m(body, punch)


def foam_grid(body: Body, punch: Punch, element_m: float, order: int = 2, even: float = 0.0,
              end_m: float | None = None) -> Grid:
    """Grid of a foam disc about the punch's axis, lengths over its thickness, bottom fixed, top at z = 0. Lines lie at
    the edge of the punch and its edge radius inwards from there, and where a layer meets its base. element_m is the
    element size at the edge, m; elements widen with the distance from there, outwards after so many even ones as fill
    that many feature lengths, and all of them halve with it. end_m: radius inside the edge at which the contact ends,
    from which they widen in place of the edge. ValueError unless 0 < element_m < thickness, the punch is
    smaller than the disc and the elements' order is one of ELEMENTS."""
    unit = body.thickness_m
    if not 0 < element_m < unit:
        raise ValueError(f"element_m must lie between 0 and the thickness of {unit} m, got {element_m}.")
    rim, profile = body.edge.size_m / unit, profile_of(punch, unit)
    edge, tip = profile.radius, profile.sharp_tip
    if edge >= rim:
        raise ValueError(f"the punch (diameter {punch.diameter_m} m) must be smaller than the disc (radius "
                         f"{body.edge.size_m} m).")
    size, feature = element_m / unit, feature_m(body, punch) / unit
    coarser = size / (_ELEMENT * feature)
    widest = (_WIDEST_UNDER_TIP if tip else _WIDEST) * body.layer_m / unit * coarser
    start = max(edge - profile.edge_radius, 0.0)
    inner, outer, under, outwards = start, edge + even * feature, edge, _OUTWARDS
    if end_m is not None:
        under, outwards = end_m / unit, _FROM_END
        inner, outer = under - _AROUND_END * feature, under + _AROUND_END * feature
        widest = min(widest, max(size, under / _INSIDE_END * coarser))

    def width(r: Array) -> Array:
        away = np.maximum((inner - r) / _INWARDS, np.maximum((r - outer) / outwards, 0))
        if tip:
            away = np.minimum(away, np.maximum(r - profile.edge_radius, 0) / _FROM_TIP)
        most = np.minimum(widest, np.inf if tip else drawn(r))
        return np.minimum(size * (1 + away / feature), np.where(r < under, most, np.inf))

    def drawn(r: Array) -> Array:
        most = max(_WIDEST_DRAWN, _DRAWN / (_MOST_DRAWN * feature)) / _ELEMENT
        return size * (most + np.maximum(start - _DRAWN - r, 0) / (_INWARDS * feature))

    def height(z: Array) -> Array:
        return size * (1 - z / (_DOWNWARDS * feature))

    stops = sorted({0.0, start, edge, rim})
    r = np.concatenate([[0.0], *(spread(a, b, width) for a, b in itertools.pairwise(stops))])
    heights = [-1.0, *([-body.layer_m / unit] if body.base_m else []), 0.0]
    z = np.concatenate([[-1.0], *(spread(a, b, height) for a, b in itertools.pairwise(heights))])
    return tensor_grid(r, z, order=order)


def tensor_grid(r: Array, z: Array, *, plane: bool = False, free: bool = False, order: int = 2) -> Grid:
    """Grid on lines r and z: bottom fixed and u_r = 0 at r = 0, or everything free; axisymmetric or plane strain.
    ValueError unless the elements' order is one of ELEMENTS."""
    if order not in ELEMENTS:
        raise ValueError(f"elements of order {order} are not built; known: {', '.join(map(str, ELEMENTS))}.")
    basis = Basis(MeshQuad.init_tensor(r, z), ELEMENTS[order](), intorder=2 * order + 1)
    column, row = (_place(ends, order, x) for ends, x in zip((r, z), basis.doflocs, strict=True))
    sequence = np.lexsort((row, column))
    number = np.empty_like(sequence)
    number[sequence] = np.arange(sequence.size)
    nodes = np.ascontiguousarray(basis.doflocs.T[sequence])
    fixed = np.zeros(nodes.shape, dtype=bool)
    if not free:
        fixed |= (nodes[:, 1] == z[0])[:, None]
        fixed[:, 0] |= nodes[:, 0] == 0
    unknown = np.where(fixed, -1, np.cumsum(~fixed.ravel()).reshape(nodes.shape) - 1)
    gradient, weight = _quadrature(basis, plane)
    surface = np.flatnonzero(nodes[:, 1] == z[-1])
    top = surface[np.arange(0, surface.size - 1, order)[:, None] + np.arange(order + 1)]
    along = np.asarray(basis.global_coordinates())[:, 0]
    within = 2 * (along - [[r[0]], [z[0]]]) / [[r[1] - r[0]], [z[1] - z[0]]] - 1
    return Grid(nodes, number[basis.element_dofs.T], unknown, gradient, weight, top, modes(within[0], within[1], order))


def modes(s: Array, t: Array, order: int) -> Array:
    """(points, 1 or 3) in whose span the logarithm of an element's change of volume is projected, at its own s along r
    and t along z in [-1, 1]."""
    return np.stack(np.broadcast_arrays(1.0, s, t)[:2 * order - 1], axis=-1)


def _place(ends: Array, order: int, x: Array) -> Indices:
    """Number of the line of nodes that each x lies on, whatever its rounding; elements of that order between ends."""
    lines = np.interp(np.arange(order * (len(ends) - 1) + 1) / order, np.arange(len(ends)), ends)
    return np.searchsorted((lines[1:] + lines[:-1]) / 2, x)


def _quadrature(basis: Basis, plane: bool) -> tuple[Array, Array]:
    radius = np.asarray(basis.global_coordinates())[0]
    gradient = np.zeros((*radius.shape, len(basis.basis), 3))
    for k, (shape,) in enumerate(basis.basis):
        gradient[:, :, k, :2] = np.moveaxis(np.asarray(shape.grad), 0, -1)
        if not plane:
            gradient[:, :, k, 2] = np.asarray(shape) / radius
    return gradient, basis.dx * (1.0 if plane else 2 * np.pi * radius)


def lagrange(order: int, t: Array) -> tuple[Array, Array]:
    """Shape functions (points, order + 1) of as many equally spaced nodes in [-1, 1] and their derivatives at t."""
    weights = np.linalg.inv(np.vander(np.linspace(-1, 1, order + 1), increasing=True))
    power = np.arange(order + 1)
    return t[:, None] ** power @ weights, power * t[:, None] ** np.maximum(power - 1, 0) @ weights


def spread(start: float, stop: float, width: Callable[[Array], Array]) -> Array:
    """Points after start, up to stop, spaced in proportion to a width and at most as wide."""
    x = np.linspace(start, stop, 2001)
    steps = np.concatenate([[0.0], np.cumsum(np.diff(x) / width((x[1:] + x[:-1]) / 2))])
    count = max(math.ceil(steps[-1] - 1e-9), 1)
    inside = np.interp(np.linspace(0, steps[-1], count + 1)[1:-1], steps, x)
    return np.append(inside, stop)
