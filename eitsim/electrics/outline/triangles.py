"""Triangles of a skin with an outline, by the package pythoncdt: lines at its edges and electrodes, sizes as asked.

They are constrained Delaunay triangles with no angle below 30 degrees, but where the outline's own are smaller.
Source: Ruppert, doi:10.1006/jagm.1995.1021.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from eitsim.electrics.mesh.p2_triangles import EDGES, sides
from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import patch_loops, stretches_along
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.outline_edge import edge_starts, places_along
from eitsim.scene.polygons import inside
from touchcal.errors import NotConverged
from touchcal.lazy import needed

if TYPE_CHECKING:
    import pythoncdt

_SAME = 1e-9  # Points of an edge closer than this share of its length are one.
_ANGLE = 30  # Least angle, degrees.
_ENOUGH = 1.1  # Area over the one asked for up to which a triangle is small enough.
_PASSES = 60  # Refinements until all triangles are small enough, at most.
_MOST = 400_000  # Corners, at most.
EVEN = 0.433  # Area of an even triangle over the square of its sides.
_FLAT = 1e-12  # Area over the square of the longest side up to which a triangle is flat by rounding.
_SHORTEST = 1e-9  # Sides that are not cut, over the size of the skin.
# Marker of an edge under no electrode; electrode k has the k-th after it.
_BARE = 1


@dataclass(frozen=True, eq=False)
class Triangles:
    """A triangulation of a skin."""

    corners_m: Array  # (n, 2) corners, m
    cells: Indices  # (t, 3) corners of each triangle, counter-clockwise
    segments: Indices  # (s, 2) corners of the edges that lie on given lines
    # (s,) 2 + k on a stretch of the outer edge under electrode k, -1 - k on the edge of the k-th loop that is left out,
    # 1 elsewhere
    marker: Indices
    loops_m: tuple[Array, ...]  # (n, 2) corners of each closed line that bounds the skin, m

    @property
    def centres_m(self) -> Array:
        """Centroids (t, 2), m."""
        return self.corners_m[self.cells].mean(axis=1)

    @property
    def area_m2(self) -> Array:
        """Areas (t,), m^2."""
        return _area_m2(self.corners_m[self.cells])


def triangulated(outline: Outline, electrodes: Electrodes | None = None, lines: Sequence[Array] = (),
                 left_out: Sequence[Array] = ()) -> Triangles:
    """The skin in triangles, as large as its lines allow: its edges, cut where line electrodes end, the edges of
    electrodes on the surface, and further closed lines (n, 2), m; without what lies inside those left out."""
    outer, *holes = outline.loops
    marker, patches = np.full(len(outer), _BARE), []
    if electrodes is not None and electrodes.along_edge:
        outer, marker = _outer(outline, electrodes)
    elif electrodes is not None:
        patches = patch_loops(electrodes)
    return of_lines([outer, *holes], marker, [*patches, *lines], left_out)


def of_lines(loops: Sequence[Array], marker: Indices, lines: Sequence[Array],
             left_out: Sequence[Array] = ()) -> Triangles:
    """What lies inside the first of closed lines (n, 2), m, and outside the others, in triangles, with further lines
    and without what lies inside those left out; marker: of the edges of the first line."""
    parts = [*loops, *lines, *left_out]
    starts = np.cumsum([0, *map(len, parts)])
    numbers = [start + np.arange(len(part)) for start, part in zip(starts, parts, strict=False)]
    segments = np.vstack([np.column_stack([number, np.roll(number, -1)]) for number in numbers])
    further = len(segments) - len(marker) - sum(map(len, left_out))
    markers = np.concatenate([marker, np.full(further, _BARE), *(np.full(len(loop), -1 - k)
                                                                 for k, loop in enumerate(left_out))])
    corners, number = np.unique(np.vstack(parts), axis=0, return_inverse=True)
    empty = np.empty((0, 3), dtype=np.int64)
    return _made(Triangles(corners, empty, number.ravel()[segments], markers, (*loops, *left_out)),
                 lambda places_m: np.full(len(places_m), np.inf))


def _outer(outline: Outline, electrodes: Electrodes) -> tuple[Array, Indices]:
    """Corners (n, 2), m, of the outer edge with the ends of line electrodes, and markers (n,) of the edges after them.
    """
    starts = edge_starts(outline)
    whole, ends = starts[-1], stretches_along(outline, electrodes)
    arcs = np.sort(np.concatenate([starts[:-1], np.mod(ends.ravel(), whole)]))
    arcs = arcs[np.diff(arcs, append=arcs[0] + whole) > _SAME * whole]
    middle = arcs + np.diff(arcs, append=arcs[0] + whole) / 2
    marker = np.full(len(arcs), _BARE)
    for k, (first, last) in enumerate(ends):
        marker[np.mod(middle - first, whole) < last - first] = _BARE + 1 + k
    return places_along(outline, arcs), marker


def refined(mesh: Triangles, area_m2: Callable[[Array], Array]) -> Triangles:
    """The triangles cut until each has about the area (t,), m^2, that is asked for at its centroid (t, 2), m, or less;
    lines stay where they are."""
    return _made(mesh, area_m2)


def cut(mesh: Triangles, area_m2: Array) -> Triangles:
    """The triangles cut, each to parts about as small as its area (t,), m^2, and what their neighbours need."""
    nearest = KDTree(mesh.centres_m)
    return _made(mesh, lambda places_m: area_m2[nearest.query(places_m)[1]])


def _with_lines_cut(mesh: Triangles, area_m2: Callable[[Array], Array]) -> Triangles:
    """The mesh with its lines halved until no piece is longer than the side of an even triangle of the area there."""
    corners, segments, marker = mesh.corners_m, mesh.segments, mesh.marker
    while True:
        start, end = corners[segments[:, 0]], corners[segments[:, 1]]
        middle, squared = (start + end) / 2, np.sum((end - start) ** 2, axis=1)
        long = EVEN * squared > area_m2(middle)
        if not long.any():
            return replace(mesh, corners_m=corners, segments=segments, marker=marker)
        number = len(corners) + np.arange(np.count_nonzero(long))
        _check_number(len(corners) + len(number))
        corners = np.vstack([corners, middle[long]])
        halves = [np.column_stack([segments[long, 0], number]), np.column_stack([number, segments[long, 1]])]
        segments = np.vstack([segments[~long], *halves])
        marker = np.concatenate([marker[~long], marker[long], marker[long]])


def _made(mesh: Triangles, area_m2: Callable[[Array], Array]) -> Triangles:
    """Triangles with the corners and lines of a mesh and further corners, so small as asked for."""
    cdt: Any = needed("pythoncdt", "skins with an outline")
    mesh = _with_lines_cut(mesh, area_m2)
    low, high = mesh.corners_m.min(axis=0), mesh.corners_m.max(axis=0)
    size = float((high - low).max())
    work: Any = cdt.Triangulation(cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.TRY_RESOLVE, 0.0)
    # corners around the skin: without them triangles outside, between corners of one edge, are flat by rounding
    box = np.array([low - size, [high[0] + size, low[1] - size], high + size, [low[0] - size, high[1] + size]])
    work.insert_vertices(np.vstack([mesh.corners_m, box]))
    work.insert_edges(mesh.segments.astype(np.uint32))
    shortest = _SHORTEST * size
    _well_shaped(work, mesh, shortest)
    for _ in itertools.repeat(None, _PASSES):
        corners, cells = _current(work)
        middle = corners[cells].mean(axis=1)
        large = _area_m2(corners[cells]) > _ENOUGH * area_m2(middle)
        large[large] = _on_skin(mesh, corners, cells[large])
        if not large.any():
            break
        work.insert_vertices(_new_corners(work, corners, cells[large]))
        _well_shaped(work, mesh, shortest)
    corners, cells = _current(work)
    used, number = np.unique(cells[_on_skin(mesh, corners, cells)], return_inverse=True)
    segments, marker = _lines(work, mesh)
    renumbered = np.full(len(corners), -1)
    renumbered[used] = np.arange(len(used))
    segments = renumbered[segments]
    on_skin = (segments >= 0).all(axis=1)
    return Triangles(corners[used], number.reshape(-1, 3), segments[on_skin], marker[on_skin], mesh.loops_m)


def _new_corners(work: "pythoncdt.Triangulation", corners: Array, cells: Indices) -> Array:
    """Corners (n, 2), m, by which triangles are halved: the middle of the longest side of each; the centroid where this
    side lies on a line, which is then cut for it."""
    ends = np.sort(np.stack([cells, np.roll(cells, -1, axis=1)], axis=2), axis=2)
    length = np.linalg.norm(corners[ends[..., 1]] - corners[ends[..., 0]], axis=2)
    longest = ends[np.arange(len(cells)), np.argmax(length, axis=1)] @ [len(corners), 1]
    lines = np.array([edge.v1 * len(corners) + edge.v2 for edge in work.fixed_edges_iter()])
    on_line = np.isin(longest, lines)
    middles = corners[np.column_stack(np.divmod(np.unique(longest[~on_line]), len(corners)))].mean(axis=1)
    return np.vstack([middles, corners[cells[on_line]].mean(axis=1)])


def _well_shaped(work: "pythoncdt.Triangulation", mesh: Triangles, shortest_m: float) -> None:
    """Cut triangles with small angles, and their neighbours."""
    import pythoncdt as cdt

    off = set(np.flatnonzero(~_on_skin(mesh, *_current(work))).tolist())
    work.refine_triangles(_MOST, cdt.RefinementCriterion.SMALLEST_ANGLE, np.radians(_ANGLE), off, shortest_m)
    _check_number(work.vertices_count())


def _current(work: "pythoncdt.Triangulation") -> tuple[Array, Indices]:
    """Corners (n, 2) and triangles (t, 3) of a triangulation at work, whose first three corners lie around all others.
    """
    vertices = work.vertices_array(copy=False)
    return (np.column_stack([vertices["x"], vertices["y"]]),
            work.triangles_array(copy=False)["vertices"].astype(np.int64))


def _on_skin(mesh: Triangles, corners: Array, cells: Indices) -> NDArray[np.bool_]:
    """Which triangles (t,) lie on the skin; not the flat ones between corners of one edge."""
    ends = np.vstack([np.roll(loop, -1, axis=0) for loop in mesh.loops_m])
    place = corners[cells]
    longest = np.linalg.norm(place - np.roll(place, 1, axis=1), axis=2).max(axis=1)
    out = (cells > 2).all(axis=1) & (_area_m2(place) > _FLAT * longest**2)
    out[out] = inside(place[out].mean(axis=1), np.vstack(mesh.loops_m), ends)
    return out


def _area_m2(corners: Array) -> Array:
    """Areas (t,), m^2, of triangles (t, 3, 2), positive counter-clockwise."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2


def _lines(work: "pythoncdt.Triangulation", mesh: Triangles) -> tuple[Indices, Indices]:
    """Corners (s, 2) of the pieces of a mesh's lines, and the marker of each."""
    ends = np.sort(mesh.segments + 3, axis=1).tolist()
    marker = {(first, last): int(one) for (first, last), one in zip(ends, mesh.marker, strict=True)}
    of = {(piece.v1, piece.v2): [(edge.v1, edge.v2) for edge in edges]
          for piece, edges in work.piece_to_originals_iter()}
    pieces = [(edge.v1, edge.v2) for edge in work.fixed_edges_iter()]
    found = [next((one for edge in of.get(piece, [piece]) if (one := marker[edge]) != _BARE), _BARE)
             for piece in pieces]
    return np.array(pieces, dtype=np.int64), np.array(found, dtype=np.int64)


def _check_number(count: int) -> None:
    if count > _MOST:
        raise NotConverged(f"the skin needs more than {_MOST} corners of triangles; give wider electrodes, a larger "
                           "fillet_mm, or ask for less accuracy.")


def skin_mesh(mesh: Triangles, electrodes: Electrodes, element: str = "P2", patches: Sequence[Array] = ()) -> SkinMesh:
    """The triangles as a mesh with straight edges, of "P2" or "P1" elements, and what of it lies under electrodes:
    along the edge, or inside patches (n, 2), m, by default those on the surface."""
    corners, cells = mesh.corners_m, mesh.cells
    nodes, under, electrode = corners, np.empty((0, 2), dtype=np.int64), np.empty(0, dtype=np.int64)
    kept = mesh.marker > _BARE
    if electrodes.along_edge:
        under, electrode = mesh.segments[kept], mesh.marker[kept] - _BARE - 1
    if element == "P2":
        keys, number = np.unique(_keys(sides(cells), len(corners)), return_inverse=True)
        ends = np.column_stack(np.divmod(keys, len(corners)))
        nodes = np.vstack([corners, corners[ends].mean(axis=1)])
        cells = np.column_stack([cells, len(corners) + number.reshape(len(EDGES), -1).T])
        middle = len(corners) + np.searchsorted(keys, _keys(np.sort(under, axis=1), len(corners)))
        under = np.column_stack([under, middle])
    if not electrodes.along_edge:
        owner = _owners(mesh.centres_m, patches or patch_loops(electrodes))
        under, electrode = cells[owner >= 0], owner[owner >= 0]
    return SkinMesh(nodes, cells, under, electrode, electrodes.count, element)


def _keys(edges: Indices, size: int) -> Indices:
    """One number of each edge (n, 2) between fewer than `size` corners, the lower number first."""
    return edges[:, 0] * size + edges[:, 1]


def _owners(points: Array, patches: Sequence[Array]) -> Indices:
    """The patch (n,) that each point lies on, -1 where none does."""
    owner = np.full(len(points), -1)
    for k, patch in enumerate(patches):
        owner[inside(points, patch, np.roll(patch, -1, axis=0))] = k
    return owner
