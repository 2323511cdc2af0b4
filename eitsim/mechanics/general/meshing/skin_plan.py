"""The skin seen from above, outside circles about its punches: triangles of its outline near them.

Circles are cut into the sectors of what is revolved about each punch. Where Delaunay's triangles miss a piece of an
edge or a sector of a circle, it is halved, until all are there. Lengths in foam thicknesses.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from eitsim.mechanics.general.meshing.bodies import Bodies, Pad
from eitsim.mechanics.general.meshing.edge_path import EdgePath, edge_path, open_path, pieces
from eitsim.mechanics.general.meshing.graded_triangles import cross, filled, quadratic
from eitsim.mechanics.solid.grid import spread
from eitsim.scene.polygons import inside
from touchcal.arrays import Array
from touchcal.errors import NotConverged

Indices = NDArray[np.int64]

# Growth of triangles per distance, their largest size, and how often pieces are halved.
_HALVINGS = 12
# Length of a sector, or a piece of an edge, over its distance to the next thing, at most.
_STRETCHED = 1.5


@dataclass(frozen=True, eq=False)
class Circle:
    """What is revolved about a punch ends here."""

    centre: Array  # (2,)
    radius: float
    angles: Array  # (sectors + 1,) ends of the sectors, the first one again at the end plus a turn

    def at(self, angle: Array) -> Array:
        return self.centre + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    @property
    def corners(self) -> Array:
        return self.at(self.angles[:-1])


@dataclass(frozen=True, eq=False)
class Plan:
    """Quadratic triangles outside the circles."""

    circles: tuple[Circle, ...]
    nodes: Array  # (n, 2)
    cells: Indices  # (t, 6) counter-clockwise; middles on circles and on the skin's edge
    corners: int  # how many of the nodes are corners
    cut: NDArray[np.bool_]  # (n,) nodes where the skin goes on and the mesh does not
    plated: NDArray[np.bool_]  # (n,) nodes of the edge under plates
    padded: NDArray[np.bool_]  # (t,) triangles under pads


def circles_about(centres: Array, radii: Array, sectors: int, loops: tuple[Array, ...], shortest: float
                  ) -> tuple[Circle, ...]:
    """Circles with sectors as short as the distance to an edge, or to another circle, asks; their least length."""
    edge = np.vstack([edge_path(loop).at(np.linspace(0, edge_path(loop).arc[-1], 2000)) for loop in loops])
    away = KDTree(edge)
    found = []
    for k, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        def width(angle: Array, centre: Array = centre, radius: float = float(radius), k: int = k) -> Array:
            at = Circle(centre, radius, angle).at(angle)
            room = away.query(at)[0]
            for j in range(len(centres)):
                if j != k:
                    room = np.minimum(room, np.linalg.norm(at - centres[j], axis=1) - radii[j])
            return np.clip(_STRETCHED * room / radius, shortest / radius, 2 * np.pi / sectors)

        found.append(Circle(centre, float(radius), np.append(0.0, spread(0.0, 2 * np.pi, width))))
    return tuple(found)


def plan(circles: tuple[Circle, ...], loops: tuple[Array, ...], growth: float, largest: float, reach: Array,
         bodies: Bodies) -> Plan:
    """Triangles of the skin inside closed polygons, holes clockwise, as far as `reach` (circles,) from the circles'
    centres, with lines where bodies end. NotConverged where no conforming ones are found."""
    paths = [edge_path(loop) for loop in loops]
    start = np.vstack([path.corners[:-1] for path in paths])
    end = np.vstack([path.corners[1:] for path in paths])
    centres = np.array([circle.centre for circle in circles])

    def beyond(p: Array) -> Array:
        return np.min([np.linalg.norm(p - c, axis=-1) - r for c, r in zip(centres, reach, strict=True)], axis=0)

    far = (reach + 3 * largest)[:, None]
    box = ((centres - far).min(axis=0), (centres + far).max(axis=0))
    def skin(p: Array) -> NDArray[np.bool_]:
        outside = [np.linalg.norm(p - circle.centre, axis=1) > circle.radius for circle in around]
        return np.all([inside(p, start, end), beyond(p) < 3 * largest, *outside], axis=0)

    around = circles
    rims, paths = len(paths), [*paths, *(open_path(pad.line) if len(pad.ends) else edge_path(pad.line[:-1])
                                    for pad in bodies.pads)]
    stops = [bodies.ends, *[bodies.ends[:0]] * (len(paths) - 1)]
    cuts = [pieces(path, lambda p: _by_circles(circles, p, growth, largest), ends)
            for path, ends in zip(paths, stops, strict=True)]
    for _ in range(_HALVINGS):
        sizes = _sizes(circles, paths, cuts, growth, largest)
        lines = [path.at(cut[0 if path.closed else 1:-1]) for path, cut in zip(paths, cuts, strict=True)]
        given = np.vstack([*(circle.corners for circle in circles), *lines])
        starts = np.cumsum([0, *(len(c.angles) - 1 for c in circles), *map(len, lines)])
        near = beyond(given) < 3 * largest
        near[:starts[len(circles)]] = True

        points, cells = filled(given[near], sizes, skin, box)
        number = np.full(len(given), -1)
        number[near] = np.arange(near.sum())
        cells = _kept(circles, points, cells, lines[:rims], beyond)
        within = [number[a:b] for a, b in itertools.pairwise(starts)]
        loops_of = [np.append(line, line[:1]) for line in within[:len(circles) + rims]]
        loops_of += [_from_edge(line, pad, cuts[0], within[len(circles)])
                     for line, pad in zip(within[len(circles) + rims:], bodies.pads, strict=True)]
        sides = [1] * (len(circles) + rims) + [2] * len(bodies.pads)
        missing = [_missing(loop, cells, points, beyond, side) for loop, side in zip(loops_of, sides, strict=True)]
        if not any(m.any() for m in missing):
            return _quadratic(circles, paths, cuts, loops_of, points, cells, bodies)
        circles = tuple(replace(c, angles=_halved(c.angles, m)) for c, m in zip(circles, missing, strict=False))
        cuts = [_halved(cut, m) for cut, m in zip(cuts, missing[len(circles):], strict=True)]
    raise NotConverged("no mesh of the skin between these punches and its edges was found; leave larger gaps.")


def _by_circles(circles: tuple[Circle, ...], p: Array, growth: float, largest: float) -> Array:
    out = np.full(p.shape[:-1], largest)
    for circle in circles:
        away = p - circle.centre
        angle = np.mod(np.arctan2(away[..., 1], away[..., 0]), 2 * np.pi)
        step = np.diff(circle.angles)[np.clip(np.searchsorted(circle.angles, angle, side="right") - 1, 0,
                                              len(circle.angles) - 2)]
        distance = np.maximum(np.linalg.norm(away, axis=-1) - circle.radius, 0.0)
        out = np.minimum(out, circle.radius * step + growth * distance)
    return out


def _sizes(circles: tuple[Circle, ...], paths: list[EdgePath], cuts: list[Array], growth: float, largest: float):
    """Sizes by the circles' sectors and the pieces of the edges."""
    middle = np.vstack([path.at((cut[1:] + cut[:-1]) / 2) for path, cut in zip(paths, cuts, strict=True)])
    length, along = np.concatenate([np.diff(cut) for cut in cuts]), KDTree(middle)

    def size(p: Array) -> Array:
        away, nearest = along.query(p)
        return np.minimum(_by_circles(circles, p, growth, largest), length[nearest] + growth * away)

    return size


def _kept(circles: tuple[Circle, ...], points: Array, cells: Indices, rim: list[Array], beyond) -> Indices:
    middle = points[cells].mean(axis=1)
    start, end = np.vstack(rim), np.vstack([np.roll(loop, -1, axis=0) for loop in rim])
    kept = inside(middle, start, end) & (beyond(middle) < 0)
    for circle in circles:
        corners = circle.corners
        kept &= ~inside(middle, corners, np.roll(corners, -1, axis=0))
    return cells[kept]


def _from_edge(line: Indices, pad: Pad, cut: Array, edge: Indices) -> Indices:
    """The points of a pad's line (n,), the first again at the end or between those at the ends of arcs of the edge."""
    if not len(pad.ends):
        return np.append(line, line[:1])
    length = cut[-1] - cut[0]
    at = [edge[np.argmin(np.abs(np.mod(cut[:-1] - end + length / 2, length) - length / 2))] for end in pad.ends]
    return np.concatenate([at[:1], line, at[1:]])


def _missing(loop: Indices, cells: Indices, points: Array, beyond, sides_of: int) -> NDArray[np.bool_]:
    """Which pieces of a line of points near the circles are no side of exactly so many triangles."""
    size = len(points)
    sides = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1)
    keys, seen = np.unique(sides[:, 0] * size + sides[:, 1], return_counts=True)
    ends = np.sort(np.column_stack([loop[:-1], loop[1:]]), axis=1)
    asked = (ends[:, 0] >= 0) & (beyond(points[np.maximum(ends, 0)].mean(axis=1)) < -0.5)
    wrong = ~np.isin(ends[:, 0] * size + ends[:, 1], keys[seen == sides_of])
    return asked & wrong


def _halved(ends: Array, which: NDArray[np.bool_]) -> Array:
    return np.sort(np.append(ends, ((ends[1:] + ends[:-1]) / 2)[which]))


def _quadratic(circles: tuple[Circle, ...], paths: list[EdgePath], cuts: list[Array], loops: list[Indices],
               points: Array, cells: Indices, bodies: Bodies) -> Plan:
    used, cells = np.unique(cells, return_inverse=True)
    cells, place = cells.reshape(-1, 3), np.full(len(points) + 1, -1)
    place[used] = np.arange(len(used))
    nodes, whole, edges = quadratic(points[used], cells)
    keys = edges[:, 0] * len(used) + edges[:, 1]
    on_edge, plated = np.zeros(len(edges), dtype=bool), np.zeros(len(nodes), dtype=bool)
    curves = [(c.at, c.angles) for c in circles] + [(path.at, cut) for path, cut in zip(paths, cuts, strict=True)]
    for k, ((at, ends), loop) in enumerate(zip(curves, loops, strict=True)):
        both = np.sort(place[np.column_stack([loop[:-1], loop[1:]])], axis=1)
        key = both[:, 0] * len(used) + both[:, 1]
        there = (both[:, 0] >= 0) & np.isin(key, keys)
        at_edge = np.searchsorted(keys, key[there])
        nodes[len(used) + at_edge] = at((ends[1:] + ends[:-1])[there] / 2)
        on_edge[at_edge] = True
        if k == len(circles):
            under = _under(bodies.plates, ((ends[1:] + ends[:-1]) / 2)[there], paths[0].arc[-1])
            plated[len(used) + at_edge[under]] = True
            plated[both[there][under]] = True
    once = np.bincount(whole[:, 3:].ravel(), minlength=len(nodes))[len(used):] == 1
    cut = np.zeros(len(nodes), dtype=bool)
    open_side = np.flatnonzero(once & ~on_edge)
    cut[edges[open_side]] = True
    cut[len(used) + open_side] = True
    if np.any(cross(nodes[whole[:, 1]] - nodes[whole[:, 0]], nodes[whole[:, 2]] - nodes[whole[:, 0]]) <= 0):
        raise NotConverged("a triangle of the skin is turned over; leave larger gaps between punches and edges.")
    middle = nodes[whole[:, :3]].mean(axis=1)
    padded = np.any([inside(middle, pad.outline[:-1], pad.outline[1:]) for pad in bodies.pads], axis=0)
    return Plan(circles, nodes, whole, len(used), cut, plated, np.broadcast_to(padded, len(whole)))


def _under(plates: Array, arc: Array, length: float) -> NDArray[np.bool_]:
    """Which places (n,) of an edge of so much length lie under a plate."""
    return np.any(np.mod(arc[:, None] - plates[:, 0], length) < plates[:, 1] - plates[:, 0], axis=1)
