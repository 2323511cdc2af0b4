"""A mesh that follows touches: curved triangles in rings about each punch, a graded triangulation between."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import Delaunay, KDTree

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from eitsim.electrics.cem.ring_scattering import position
from eitsim.electrics.mesh.p2_triangles import sides, straight, untangled
from eitsim.electrics.mesh.ring_mesh import centred_radii, inside_rim, patch_radii, rim_angles
from eitsim.scene.edges.disc import Disc
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch
from touchcal.errors import NotConverged

Touches = tuple[tuple[Punch, Touch], ...]

# Least distance of the other points from circles and rim, in sizes, and how often they are moved to their neighbours'
# mean.
_CLOSEST, _SMOOTHINGS = 0.6, 3
# A rim edge is no longer than so many of its distances to a circle, which is no closer than so many disc radii.
_NEAR, _TOUCHING = 2.0, 1e-9
# Where a rim edge is cut, from an end that two electrodes share: the current density grows towards it as one over the
# distance, until z S.
_SHARED = (1 / 27, 1 / 9, 1 / 3)


@dataclass(frozen=True)
class Grading:
    """Sizes on level 1."""

    # edges along the rim under an electrode and between two of them, at least, and about how many on the whole rim
    under: int
    between: int
    around: int
    # triangles around a circle, at least, and their length in widths of the outermost rings, at most
    sectors: int
    stretched: float
    # growth of the triangles per unit of distance, and their largest size in disc radii
    growth: float
    largest: float
    steepest: float  # part of the stretches' whole change in a ring, at most


# For fields on one mesh, and for meshes that are halved.
EVEN = Grading(2, 6, 128, 32, 1.0, 0.3, 0.15, np.inf)
LEAN = Grading(3, 4, 112, 12, 3.0, 0.8, 0.4, 0.12)


@dataclass(frozen=True)
class _Circle:
    """Rings about a punch."""

    centre_m: Array  # (2,) axis, m
    # (rings + 1,) radii from 0, m
    radii_m: Array
    sectors: int

    @property
    def radius_m(self) -> float:
        return float(self.radii_m[-1])

    @property
    def size_m(self) -> float:
        """Length of the triangles outside."""
        return 2 * np.pi * self.radius_m / self.sectors


def triangulation(body: Body, electrodes: Electrodes, touches: Touches,
                  level: int = 1, thinner: int = 1, grading: Grading = EVEN) -> SkinMesh:
    """P2 mesh of the disc with circles at the punches' edges, the starts of their fillets and the ends of contact.

    Level n divides all sizes by n, `thinner` the widths of the rings at these circles alone.
    Patches lie on rings of triangles outside. ValueError where punches overlap or overhang the rim or these rings.
    """
    patches = patch_radii(body, electrodes, 2 * level)
    touches, gaps = _gaps(touches, patches)
    circles = [_circle(punch, touch, gap, level, thinner, grading)
               for (punch, touch), gap in zip(touches, gaps, strict=True)]
    angles, electrode = _rim(body, electrodes, circles, level, grading)
    spoke = np.column_stack([np.cos(angles), np.sin(angles)])
    body, rim = replace(body, edge=Disc(float(patches[0]))), patches[0] * spoke
    parts = [_rings(circle) for circle in circles]
    ends = np.cumsum([0, *(len(nodes) for nodes, _ in parts)])
    outlines = [end - circle.sectors + np.arange(circle.sectors) for circle, end in zip(circles, ends[1:], strict=True)]
    outline = np.concatenate([*outlines, ends[-1] + np.arange(len(rim))])
    corners = np.vstack([*(nodes for nodes, _ in parts), rim])
    fill, between = _between(body, circles, corners[outline], rim, level, grading)
    numbers = np.concatenate([outline, len(corners) + np.arange(len(fill))])
    corners = np.vstack([corners, fill])
    cells = np.vstack([*(cells + start for (_, cells), start in zip(parts, ends, strict=False)), numbers[between]])
    loops = np.arange(len(rim) * (len(patches) - 1)).reshape(-1, len(rim)) + len(corners)
    loops = np.vstack([ends[-1] + np.arange(len(rim)), loops])
    corners = np.vstack([corners, (patches[1:, None, None] * spoke).reshape(-1, 2)])
    return _quadratic(circles, ends, corners, cells, loops, electrode, electrodes.count)


def _gaps(touches: Touches, patches: Array) -> tuple[Touches, Array]:
    """The touches, each with its end of contact inside the rim, and the distance of each to the rim or to the middle of
    the way to another, m."""
    kept, to_rim = zip(*(inside_rim(punch, touch, patches) for punch, touch in touches), strict=True)
    touches = tuple((punch, touch) for (punch, _), touch in zip(touches, kept, strict=True))
    radius = np.array([max(punch.diameter_m / 2, touch.contact_radius_m) for punch, touch in touches])
    centre = np.array([position(punch) for punch, _ in touches])
    separation = np.abs(np.subtract.outer(centre, centre)) - np.add.outer(radius, radius)
    np.fill_diagonal(separation, np.inf)
    if separation.min() <= 0:
        raise ValueError(f"two punches or their contacts overlap by {-separation.min() * 1e3:.1f} mm; leave a gap.")
    return touches, np.minimum(to_rim, separation.min(axis=1) / 2)


def _circle(punch: Punch, touch: Touch, gap: float, level: int, thinner: int, grading: Grading) -> _Circle:
    radii = centred_radii(punch, touch, gap, level, thinner, grading.steepest)
    around = 2 * np.pi * radii[-1] / (grading.stretched * max(np.diff(radii)[-3:].max(), punch.fillet_m / 2 / level))
    return _Circle(np.array([punch.x_m, punch.y_m]), radii, max(grading.sectors * level, int(np.ceil(around))))


def _rim(body: Body, electrodes: Electrodes, circles: list[_Circle], level: int,
         grading: Grading) -> tuple[Array, Indices]:
    """Angles of the nodes on the rim and the electrode that follows each, as `rim_angles`, finer at ends that two
    electrodes share and halved where a circle is near."""
    angles, electrode = _finer_at_shared_ends(*rim_angles(
        body, electrodes, level, under=grading.under, between=grading.between, around=grading.around))
    while True:
        width = np.diff(angles, append=angles[0] + 2 * np.pi)
        middle = body.radius_m * np.exp(1j * (angles + width / 2))
        away = [np.abs(middle - complex(*circle.centre_m)) - circle.radius_m for circle in circles]
        if np.min(away) < _TOUCHING * body.radius_m:
            raise ValueError("the edge of a punch or of its contact touches the rim, and a mesh needs a gap between "
                             "them; move the punch inwards by a thousandth of a millimetre or more.")
        long = np.flatnonzero(body.radius_m * width > _NEAR * np.min(away, axis=0))
        if not len(long):
            return angles, electrode
        angles = np.insert(angles, long + 1, angles[long] + width[long] / 2)
        electrode = np.insert(electrode, long + 1, electrode[long])


def _finer_at_shared_ends(angles: Array, electrode: Indices) -> tuple[Array, Indices]:
    width, before = np.diff(angles, append=angles[0] + 2 * np.pi), np.roll(electrode, 1)
    start = np.flatnonzero((electrode >= 0) & (before >= 0) & (electrode != before))
    cuts = [(start, cut) for cut in _SHARED] + [((start - 1) % len(angles), 1 - cut) for cut in _SHARED]
    edge = np.concatenate([edges for edges, _ in cuts])
    new = np.concatenate([angles[edges] + cut * width[edges] for edges, cut in cuts])
    angles, electrode = np.append(angles, new), np.append(electrode, electrode[edge])
    order = np.argsort(angles, kind="stable")
    return angles[order], electrode[order]


def _rings(circle: _Circle) -> tuple[Array, Indices]:
    """Corners, the axis first, the outermost ring last, and triangles (n, 3)."""
    count, rings = circle.sectors, len(circle.radii_m) - 1
    angle = 2 * np.pi * np.arange(count) / count
    spoke = np.column_stack([np.cos(angle), np.sin(angle)])
    corners = (circle.radii_m[1:, None, None] * spoke).reshape(-1, 2)
    number = 1 + np.arange(rings * count).reshape(rings, count)
    fan = np.column_stack([np.zeros(count, dtype=int), number[0], np.roll(number[0], -1)])
    return circle.centre_m + np.vstack([np.zeros((1, 2)), corners]), np.vstack([fan, ring_cells(number)])


def ring_cells(number: Indices) -> Indices:
    """Triangles (2 (rings - 1) m, 3) between loops of corners (rings, m): one of every quadrilateral, then the other.
    """
    after = np.roll(number, -1, axis=1)
    inner, outer, outer_after, inner_after = (a.ravel() for a in (number[:-1], number[1:], after[1:], after[:-1]))
    return np.vstack([np.column_stack([inner, outer, outer_after]), np.column_stack([inner, outer_after, inner_after])])


def _between(body: Body, circles: list[_Circle], outline: Array, rim: Array, level: int,
             grading: Grading) -> tuple[Array, Indices]:
    """Points between circles and rim, and triangles of the outline's points and these."""
    spacing = np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=1)
    along = KDTree(rim)

    def size(points: Array) -> Array:
        reach, nearest = along.query(points)
        out = np.minimum(spacing[nearest] + grading.growth * reach, grading.largest * body.radius_m / level)
        for circle in circles:
            away = np.linalg.norm(points - circle.centre_m, axis=1) - circle.radius_m
            out = np.minimum(out, circle.size_m + grading.growth * np.maximum(away, 0))
        return out

    fill = _leaves(body, circles, size)
    fill = fill[KDTree(outline).query(fill)[0] > _CLOSEST * size(fill)]
    for _ in range(_SMOOTHINGS):
        cells = _kept(circles, outline, fill)
        fill = _smoothed(fill, np.vstack([outline, fill]), cells)
    cells = _kept(circles, outline, fill)
    _check_outline(circles, len(rim), cells)
    return fill, cells


def _leaves(body: Body, circles: list[_Circle], size: Callable[[Array], Array]) -> Array:
    """Middles (n, 2) of the squares of a quadtree that are no larger than the size there, outside the circles."""
    side = 2 * body.radius_m
    found, squares = [], np.zeros((1, 2))
    while len(squares):
        large = side > size(squares)
        found.append(squares[~large])
        side /= 2
        quarter = side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        squares = (squares[large, None] + quarter).reshape(-1, 2)
    points = np.vstack(found)
    free = np.linalg.norm(points, axis=1) < body.radius_m
    for circle in circles:
        free &= np.linalg.norm(points - circle.centre_m, axis=1) > circle.radius_m
    return points[free]


def _kept(circles: list[_Circle], outline: Array, fill: Array) -> Indices:
    """Delaunay triangles outside the circles; the outline's points are the circles' in their order, then the rim's."""
    points = np.vstack([outline, fill])
    cells = Delaunay(points).simplices
    middle = points[cells].mean(axis=1)
    outside = np.ones(len(cells), dtype=bool)
    for circle in circles:
        away = np.linalg.norm(middle - circle.centre_m, axis=1)
        outside &= away > circle.radius_m * np.cos(np.pi / circle.sectors)
    return cells[outside]


def _smoothed(fill: Array, points: Array, cells: Indices) -> Array:
    one, other = np.vstack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]).T
    count = np.bincount(one, minlength=len(points)) + np.bincount(other, minlength=len(points))
    mean = [(np.bincount(one, points[other, i], len(points)) + np.bincount(other, points[one, i], len(points)))
            / np.maximum(count, 1) for i in (0, 1)]
    return np.column_stack(mean)[len(points) - len(fill):]


def _check_outline(circles: list[_Circle], on_rim: int, cells: Indices) -> None:
    """NotConverged where a circle or the rim is not made of edges of one triangle each."""
    start, requested = 0, []
    for count in [*(circle.sectors for circle in circles), on_rim]:
        loop = start + np.arange(count)
        requested.append(np.sort(np.column_stack([loop, np.roll(loop, -1)]), axis=1))
        start += count
    size = int(cells.max(initial=start)) + 1
    edges, seen = np.unique(_keys(sides(cells), size), return_counts=True)
    if not np.array_equal(edges[seen == 1], np.unique(_keys(np.vstack(requested), size))):
        raise NotConverged("no mesh of the skin between these touches was found; leave a larger gap or ask for a "
                           "larger signal in [accuracy].")


def _keys(edges: Indices, size: int) -> Indices:
    """One number of each edge (n, 2) between fewer than `size` corners, ordered as the edges are."""
    return edges[:, 0] * size + edges[:, 1]


def _quadratic(circles: list[_Circle], ends: Indices, corners: Array, cells: Indices, loops: Indices,
               electrode: Indices, count: int) -> SkinMesh:
    """Middle nodes on every edge, in polar coordinates about its circle or, along the rim and in the rings between the
    loops (rings + 1, m), about the disc; halfway where a circle's edges bulge more than what lies next to them is wide.
    """
    covered = ring_cells(loops)
    cells = np.vstack([cells, covered])
    keys, number = np.unique(_keys(sides(cells), len(corners)), return_inverse=True)
    edges = np.column_stack(np.divmod(keys, len(corners)))
    middle = corners[edges].mean(axis=1)
    for circle, start, end in zip(circles, ends, ends[1:], strict=False):
        inside = (edges[:, 0] > start) & (edges[:, 1] < end)
        middle[inside] = turned(corners[edges[inside]], circle.centre_m)
    rim = loops[0]
    polar = np.vstack([np.sort(np.column_stack([rim, np.roll(rim, -1)]), axis=1), sides(covered)])
    along = np.searchsorted(keys, _keys(polar, len(corners)))
    middle[along] = turned(corners[polar], np.zeros(2))
    quadratic = np.column_stack([cells, len(corners) + number.reshape(3, -1).T])
    under = np.column_stack([rim, np.roll(rim, -1), len(corners) + along[:len(rim)]])
    if len(covered):
        under, electrode = quadratic[-len(covered):], np.tile(electrode, 2 * (len(loops) - 1))
    mesh = SkinMesh(np.vstack([corners, middle]), quadratic, under[electrode >= 0], electrode[electrode >= 0], count,
                    "P2")
    return untangled(mesh, straight(mesh))


def turned(ends: Array, centre: Array) -> Array:
    """Points half-way in radius and angle about a centre, of edges (n, 2, 2)."""
    first, last = ((ends[:, i] - centre) @ np.array([1, 1j]) for i in (0, 1))
    middle = (np.abs(first) + np.abs(last)) / 2 * np.exp(1j * (np.angle(first) + np.angle(last / first) / 2))
    return centre + np.column_stack([middle.real, middle.imag])
