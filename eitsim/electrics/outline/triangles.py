"""Triangles of a skin with an outline, made by the package triangle: lines at its edges and electrodes, sizes as asked.

Triangle is Shewchuk's, doi:10.1007/BFb0014497: constrained Delaunay triangles with no angle below 30 degrees, but where
the outline's own are smaller.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from eitsim.electrics.mesh.p2_triangles import EDGES, sides
from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import patch_loops, stretches_along
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.outline_edge import edge_starts, places_along
from eitsim.scene.polygons import inside
from touchcal.errors import NotConverged

_SAME = 1e-9  # Points of an edge closer than this share of its length are one.
_ANGLE = 30  # Least angle, degrees.
_PASSES = 40  # Refinements until all triangles are small enough, at most.
_ENOUGH = 1.1  # Area over the one asked for up to which a triangle is small enough.
_MOST = 400_000  # Triangles, at most.
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

    @property
    def centres_m(self) -> Array:
        """Centroids (t, 2), m."""
        return self.corners_m[self.cells].mean(axis=1)

    @property
    def area_m2(self) -> Array:
        """Areas (t,), m^2."""
        a, b, c = np.moveaxis(self.corners_m[self.cells], 1, 0)
        return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def triangulated(outline: Outline, electrodes: Electrodes | None = None, lines: Sequence[Array] = (),
                 left_out: Sequence[Array] = ()) -> Triangles:
    """The skin in triangles, as large as its lines allow: its edges, cut where line electrodes end, the edges of
    electrodes on the surface, and further closed lines (n, 2), m; without what lies inside those left out."""
    outer, *holes = outline.loops
    marker, patches = np.full(len(outer), _BARE), []
    if electrodes is not None and electrodes.kind == "line":
        outer, marker = _outer(outline, electrodes)
    elif electrodes is not None:
        patches = patch_loops(electrodes)
    parts = [outer, *holes, *patches, *lines, *left_out]
    starts = np.cumsum([0, *map(len, parts)])
    numbers = [start + np.arange(len(part)) for start, part in zip(starts, parts, strict=False)]
    segments = np.vstack([np.column_stack([number, np.roll(number, -1)]) for number in numbers])
    further = len(segments) - len(marker) - sum(map(len, left_out))
    markers = np.concatenate([marker, np.full(further, _BARE), *(np.full(len(loop), -1 - k)
                                                                 for k, loop in enumerate(left_out))])
    graph: dict[str, Any] = {"vertices": np.vstack(parts), "segments": segments, "segment_markers": markers[:, None]}
    if holes or left_out:
        graph["holes"] = np.array([_inner_point(hole) for hole in [*holes, *(loop[::-1] for loop in left_out)]])
    return _made(graph, f"pq{_ANGLE}")


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


def _inner_point(loop: Array) -> Array:
    """A point (2,) inside a closed polygon: the middle of the largest of its triangles."""
    turned = loop[::-1]
    number = np.arange(len(turned))
    whole = _made({"vertices": turned, "segments": np.column_stack([number, np.roll(number, -1)]),
                   "segment_markers": np.ones((len(turned), 1), dtype=int)}, "p")
    return whole.centres_m[np.argmax(whole.area_m2)]


def refined(mesh: Triangles, area_m2: Callable[[Triangles], Array]) -> Triangles:
    """The triangles cut until each has about the area (t,), m^2, asked for it or less; lines stay where they are."""
    for _ in itertools.repeat(None, _PASSES):
        limit = area_m2(mesh)
        if np.all(mesh.area_m2 <= _ENOUGH * limit):
            return mesh
        if len(mesh.cells) > _MOST:
            break
        mesh = cut(mesh, limit)
    raise NotConverged(f"the skin needs more than {_MOST} triangles; give wider electrodes, a larger fillet_mm, or ask "
                       "for less accuracy.")


def cut(mesh: Triangles, area_m2: Array) -> Triangles:
    """The triangles cut once, each to parts no larger than its area (t,), m^2, and what its neighbours need."""
    return _made({"vertices": mesh.corners_m, "triangles": mesh.cells, "segments": mesh.segments,
                  "segment_markers": mesh.marker[:, None], "triangle_max_area": area_m2[:, None]}, f"rpq{_ANGLE}a")


def _made(graph: dict[str, Any], options: str) -> Triangles:
    try:
        import triangle
    except ImportError:
        raise ValueError("skins with an outline need the package triangle, which is not installed; run "
                         "pip install '.[outlines]' in the project's folder.") from None
    made = triangle.triangulate(graph, options)
    return Triangles(made["vertices"], made["triangles"].astype(np.int64), made["segments"].astype(np.int64),
                     made["segment_markers"].ravel().astype(np.int64))


def skin_mesh(mesh: Triangles, electrodes: Electrodes, element: str = "P2") -> SkinMesh:
    """The triangles as a mesh with straight edges, of "P2" or "P1" elements, and what of it lies under electrodes."""
    corners, cells = mesh.corners_m, mesh.cells
    nodes, under, electrode = corners, np.empty((0, 2), dtype=np.int64), np.empty(0, dtype=np.int64)
    kept = mesh.marker > _BARE
    if electrodes.kind == "line":
        under, electrode = mesh.segments[kept], mesh.marker[kept] - _BARE - 1
    if element == "P2":
        keys, number = np.unique(_keys(sides(cells), len(corners)), return_inverse=True)
        ends = np.column_stack(np.divmod(keys, len(corners)))
        nodes = np.vstack([corners, corners[ends].mean(axis=1)])
        cells = np.column_stack([cells, len(corners) + number.reshape(len(EDGES), -1).T])
        middle = len(corners) + np.searchsorted(keys, _keys(np.sort(under, axis=1), len(corners)))
        under = np.column_stack([under, middle])
    if electrodes.kind == "surface":
        owner = _owners(mesh.centres_m, electrodes)
        under, electrode = cells[owner >= 0], owner[owner >= 0]
    return SkinMesh(nodes, cells, under, electrode, electrodes.count, element)


def _keys(edges: Indices, size: int) -> Indices:
    """One number of each edge (n, 2) between fewer than `size` corners, the lower number first."""
    return edges[:, 0] * size + edges[:, 1]


def _owners(points: Array, electrodes: Electrodes) -> Indices:
    """The electrode (n,) on the surface that each point lies on, -1 where none does."""
    owner = np.full(len(points), -1)
    for k, patch in enumerate(patch_loops(electrodes)):
        owner[inside(points, patch, np.roll(patch, -1, axis=0))] = k
    return owner
