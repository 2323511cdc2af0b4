"""The mesh of a layer: about each punch a fan of triangles, its section revolved, elsewhere triangles extruded."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from eitsim.mechanics.general.meshing.graded_triangles import EDGES
from eitsim.mechanics.general.meshing.layer_layout import FLAT, Layout, in_space
from eitsim.mechanics.general.meshing.section import Section, halved
from eitsim.mechanics.general.meshing.skin_plan import Circle, Plan
from eitsim.mechanics.general.meshing.wedge import Facets, facets, gauss_points, shapes
from touchcal.arrays import Array

Indices = NDArray[np.int64]

_SAME = 1e-7  # Nodes closer than this, thicknesses, are one.
# Height of pads, thicknesses, and their stiffness over the foam's: nearly rigid.
_PAD, _STIFF = 0.2, 1e3


@dataclass(frozen=True, eq=False)
class Revolved:
    """The section of one punch, revolved, and the fan inside it."""

    circle: Circle
    section: Section
    # radii (n + 1,), increasing, of the section's corners on the surface, and the numbers of the facets between, of the
    # first sector; those of a sector follow each other, sector after sector
    radii: Array


@dataclass(frozen=True, eq=False)
class WedgeMesh:
    """Wedges of 18 nodes, and their faces on the surface. Lengths in thicknesses."""

    nodes: Array  # (n, 3) in space
    coordinates: Array  # (n, 3) the same as the layer was laid out flat, its surface at height 0
    layout: Layout  # how that lies in space
    elements: Indices  # (e, 18)
    unknown: Indices  # (n, 3) number of the unknown of each displacement; -1 where it is zero
    # (e, 18, 3, q) derivatives of the shape functions by x, y and z at the quadrature's points; (e, q) their weights
    gradient: Array
    weight: Array
    about: tuple[Revolved, ...]
    plan: Plan
    heights: Array  # (layers + 1,) of the plan's layers
    around: Facets  # quadrilaterals of the revolved sections: punch after punch, sector after sector, outwards
    flat: Facets  # triangles: fan after fan, sector after sector, then those of the plan

    @property
    def unknowns(self) -> int:
        return int(self.unknown.max()) + 1


def wedge_mesh(plan: Plan, sections: tuple[Section, ...], heights: Array, *, layout: Layout = FLAT) -> WedgeMesh:
    """The mesh of a plan whose layers lie between heights (n,), with a section a circle; bottom fixed, sides free, but
    not under plates; pads are stiff wedges on top; laid into space. ValueError where the layer does not fit there."""
    parts, around, fans, about = [], [], [], []
    for circle, own in zip(plan.circles, sections, strict=True):
        turns = halved(circle.angles)[:-1]
        parts.append(_prisms(own.nodes, own.cells, turns, _turn_about(circle), closed=True))
        edge, radii = _top_edges(own)
        around.append(edge)
        about.append(Revolved(circle, own, radii))
        fan, cells = _fan(circle, own.core)
        parts.append(_prisms(fan, cells, own.inner, _raised))
        fans.append(len(cells))
    parts.append(_prisms(plan.nodes, plan.cells, halved(heights), _raised))
    if plan.padded.any():
        parts.append(_prisms(plan.nodes, plan.cells[plan.padded], _PAD * np.arange(3) / 2, _raised))
    coordinates, elements, starts = _merged(parts)
    fixed, nodes = _fixed(coordinates, plan), in_space(layout, coordinates)
    unknown = np.where(fixed[:, None], -1, np.cumsum(np.repeat(~fixed, 3)).reshape(-1, 3) - 1)
    gradient, weight = _quadrature(nodes[elements])
    above = 2 * len(plan.circles) + 1
    weight[starts[above]:] *= _STIFF
    quads = [(starts[2 * k] + len(own.cells) * np.arange(len(circle.angles) - 1)[:, None] + edge[0], edge)
             for k, (circle, own, edge) in enumerate(zip(plan.circles, sections, around, strict=True))]
    element = np.concatenate([number.ravel() for number, _ in quads])
    local, ends = (np.concatenate([np.tile(edge[i], (len(number), *(1,) * (edge[i].ndim - 1)))
                                   for number, edge in quads]) for i in (1, 2))
    tops = [starts[2 * k + 2] - count + np.arange(count) for k, count in enumerate(fans)]
    tops.append(starts[above] - len(plan.cells) + np.arange(len(plan.cells)))
    top = np.concatenate(tops)
    flat = facets(nodes, elements, top, np.tile(np.arange(12, 18), (len(top), 1)), np.empty((len(top), 0, 2)))
    return WedgeMesh(nodes, coordinates, layout, elements, unknown, gradient, weight, tuple(about), plan, heights,
                     facets(nodes, elements, element, local, ends), flat)


def _raised(points: Array, height: Array) -> Array:
    return np.column_stack([points, np.broadcast_to(height, len(points))])


def _turn_about(circle: Circle):
    def turned(points: Array, angle: Array) -> Array:
        away = points[:, :1] * np.array([[np.cos(angle), np.sin(angle)]])
        return np.column_stack([circle.centre + away, points[:, 1]])

    return turned


def _prisms(points: Array, cells: Indices, levels: Array, at, closed: bool = False) -> tuple[Array, Indices]:
    """Nodes and elements of triangles on levels (2n + 1,), or (2n,) that close, every second one in the middle."""
    nodes = np.concatenate([at(points, level) for level in levels])
    layers = len(levels) // 2
    level = (2 * np.arange(layers)[:, None] + np.arange(3)) % (len(levels) if closed else len(levels) + 1)
    elements = (level[:, None, :, None] * len(points) + cells[None, :, None, :]).reshape(-1, 18)
    return nodes, elements


def _fan(circle: Circle, radius: float) -> tuple[Array, Indices]:
    """Triangles from the axis to a radius, one a sector, curved outside."""
    inner = Circle(circle.centre, radius, circle.angles)
    count = len(circle.angles) - 1
    corners, middles = inner.corners, inner.at((circle.angles[1:] + circle.angles[:-1]) / 2)
    spokes = (corners + circle.centre) / 2
    k, after = np.arange(count), (np.arange(count) + 1) % count
    nodes = np.vstack([circle.centre[None], corners, spokes, middles])
    return nodes, np.column_stack([0 * k, 1 + k, 1 + after, 1 + count + k, 1 + 2 * count + k, 1 + count + after])


def _top_edges(section: Section) -> tuple[tuple[Indices, Indices, Array], Array]:
    """Cells (f,) of the section with an edge on the surface, outwards, the local nodes (f, 9) and ends (f, 2, 2) of
    the facets; and the radii (f + 1,) of the ends."""
    high = np.abs(section.nodes[:, 1]) < _SAME
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = []
    for middle, (a, b) in enumerate(EDGES, 3):
        for cell in np.flatnonzero(high[section.cells[:, a]] & high[section.cells[:, b]]):
            r = section.nodes[section.cells[cell, [a, b]], 0]
            one, other = (a, b) if r[0] < r[1] else (b, a)
            found.append((r.min(), r.max(), cell, [one, other, middle], corner[[one, other]]))
    found.sort(key=lambda edge: edge[0])
    nodes = np.array([edge[3] for edge in found])
    local = (6 * np.arange(3)[:, None] + nodes[:, None]).reshape(len(found), 9)
    radii = np.array([edge[0] for edge in found] + [found[-1][1]])
    return (np.array([edge[2] for edge in found]), local, np.array([edge[4] for edge in found])), radii


def _merged(parts: list[tuple[Array, Indices]]) -> tuple[Array, Indices, list[int]]:
    """All nodes with those in one place joined, all elements, and where each part's begin."""
    nodes = np.vstack([n for n, _ in parts])
    offset = np.cumsum([0, *(len(n) for n, _ in parts)])
    elements = np.vstack([e + o for (_, e), o in zip(parts, offset, strict=False)])
    near = KDTree(nodes).query_pairs(_SAME, output_type="ndarray")
    joined = coo_matrix((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(nodes), len(nodes)))
    _, label = connected_components(joined, directed=False)
    used, number = np.unique(label[elements], return_inverse=True)
    first = np.full(label.max() + 1, -1)
    first[label[::-1]] = np.arange(len(nodes))[::-1]
    starts = np.cumsum([0, *(len(e) for _, e in parts)]).tolist()
    return nodes[first[used]], number.reshape(-1, 18), starts


def _fixed(nodes: Array, plan: Plan) -> NDArray[np.bool_]:
    """The bottom, and the sides where the mesh is cut or under plates."""
    fixed = nodes[:, 2] < -1 + _SAME
    sides = plan.nodes[plan.cut | plan.plated]
    if len(sides):
        fixed |= KDTree(sides).query(nodes[:, :2])[0] < _SAME
    return fixed


def _quadrature(corners: Array) -> tuple[Array, Array]:
    """Derivatives (e, 18, 3, q) by position and weights (e, q) of elements with nodes (e, 18, 3); ValueError where one
    is turned over."""
    at, weight = gauss_points()
    _, slope = shapes(at)
    jacobian = np.einsum("qad,eai->eqid", slope, corners, optimize=True)
    volume = np.linalg.det(jacobian)
    if volume.min() <= 0:
        raise ValueError(f"{np.sum(volume.min(axis=1) <= 0)} elements of the mesh are turned over.")
    gradient = np.einsum("qad,eqdi->eaiq", slope, np.linalg.inv(jacobian), optimize=True)
    return np.ascontiguousarray(gradient), volume * weight
