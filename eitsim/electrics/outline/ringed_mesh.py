"""A mesh of a skin with an outline with rings of curved triangles about its touches, thin where these are steep."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from eitsim.electrics.mesh.graded_mesh import LEAN, Touches, ring_cells, turned
from eitsim.electrics.mesh.p2_triangles import EDGES, straight, untangled, with_quarter_points
from eitsim.electrics.mesh.ring_mesh import centred_radii, contact_lines
from eitsim.electrics.outline.touch_mesh import EVEN, FIELDS, base_triangles, touch_mesh, within_edges
from eitsim.electrics.outline.triangles import Triangles, refined, skin_mesh, triangulated
from eitsim.scene.edges.outline_electrodes import patch_loops
from eitsim.scene.polygons import inside, squared_distance
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch

_SIDE = 2.0  # Length of triangles along the outermost circle, at least, over the fillet radius, of rings not thinner.
_SAME = 1e-4  # Radii closer than this share of the outermost one are one.
_THINNER = 4  # Rings are so many times thinner than those of a mesh of quadrilaterals (`template`), unless given.
# Length of triangles at an end of contact that no ring follows, over the fillet radius, of rings not thinner, and its
# growth per unit of distance from there; the same of a reference.
_AT_END, _AT_END_FINE = (1.0, 0.5), (0.25, 0.3)
# Where rings end at samples: triangles around a circle, at least, and the growth of those outside per unit of distance.
# With as many as elsewhere dV of light touches 12 to 18 mm from an edge is off by 1e-4 or more.
_AROUND, _SLOWLY = 80, 0.1


@dataclass(frozen=True, eq=False)
class _Circle:
    """Rings about a punch."""

    centre_m: Array  # (2,) axis, m
    radii_m: Array  # (rings + 1,) radii from 0, m
    sectors: int  # triangles around, about
    end_m: float  # radius of the end of contact that edges cut, m, which no ring follows; infinite where they do not
    # length of the triangles there, m, and its growth per unit of distance
    thin_m: float
    growth: float

    @property
    def loop_m(self) -> Array:
        angle = 2 * np.pi * np.arange(self.sectors) / self.sectors
        return self.centre_m + self.radii_m[-1] * np.column_stack([np.cos(angle), np.sin(angle)])

    @property
    def size_m(self) -> float:
        """Length of the triangles outside."""
        return 2 * np.pi * float(self.radii_m[-1]) / self.sectors


def outlined_mesh(body: Body, electrodes: Electrodes, conductance_S: float, touches: Touches,
                  known_to: float = FIELDS, thinner: int = _THINNER, at_samples: bool = False) -> SkinMesh:
    """P2 mesh with circles at the punches' edges, the starts of their fillets and the ends of contact, in rings about
    each punch as far as half the way to the nearest edge; triangles follow the end of a contact that edges cut.
    `touch_mesh` where an electrode on the surface lies there.

    Outside, its triangles are as small as those on which the readings of the untouched skin are known to such a
    relative error; middle nodes lie at a quarter of the way from the ends of line electrodes. Where it is asked for,
    rings end at the samples of the touch and of what edges change of it, and triangles are as small as a reference
    needs. ValueError where punches reach an edge, or contacts each other.
    """
    circles = [_circle(*one, touch, thinner) for one, (_, touch) in zip(within_edges(body, touches), touches,
                                                                        strict=True)]
    if at_samples:
        circles = [_at_samples(circle, *one) for circle, one in zip(circles, touches, strict=True)]
    if any(_meets(circle, loop) for circle in circles for loop in patch_loops(electrodes)):
        return touch_mesh(body, electrodes, conductance_S, touches)
    base = base_triangles(body, electrodes, conductance_S, known_to)
    known, area = KDTree(base.centres_m), base.area_m2
    growth = _SLOWLY if at_samples else LEAN.growth

    def limit(places: Array) -> Array:
        out = area[known.query(places)[1]]
        for circle in circles:
            radius = np.linalg.norm(places - circle.centre_m, axis=1)
            size = np.minimum(circle.size_m + growth * np.maximum(radius - circle.radii_m[-1], 0),
                              circle.thin_m + circle.growth * np.abs(radius - circle.end_m))
            out = np.minimum(out, EVEN * size**2)
        return out

    around = refined(triangulated(body.outline, electrodes, left_out=[circle.loop_m for circle in circles]), limit)
    whole, ringed = _with_rings(around, circles)
    mesh = skin_mesh(whole, electrodes)
    return with_quarter_points(untangled(_curved(mesh, circles, ringed), straight(mesh)))


def _circle(punch: Punch, inside: Touch, gap: float, touch: Touch, thinner: int) -> _Circle:
    """Rings about a punch whose contact, as far as it lies inside the edges, leaves a gap, m, to these."""
    radii = centred_radii(punch, inside, gap, thinner, 1, LEAN.steepest)
    around = 2 * np.pi * radii[-1] / (LEAN.stretched * max(np.diff(radii)[-3:].max(), _SIDE * punch.fillet_m / thinner))
    end = touch.contact_radius_m if touch.contact_radius_m > inside.contact_radius_m else np.inf
    thin, growth = _AT_END
    return _Circle(np.array([punch.x_m, punch.y_m]), radii, max(LEAN.sectors, int(np.ceil(around))), end,
                   thin * punch.fillet_m / thinner, growth)


def _at_samples(circle: _Circle, punch: Punch, touch: Touch) -> _Circle:
    """The circle with rings that end at the lines of the contact and the touch's samples; samples that all but coincide
    with a line, or each other, are one."""
    last = circle.radii_m[-1]
    lines = np.array([0.0, *(line for line in contact_lines(punch, touch) if line < last), last])
    edges = touch.rim.radius_m if touch.rim is not None else np.empty(0)
    ends = np.unique(np.concatenate([touch.radius_m, edges]))
    ends = ends[(ends > 0) & (ends < last)]
    ends = ends[np.abs(ends[:, None] - lines).min(axis=1) > _SAME * last]
    ends = ends[np.append(True, np.diff(ends) > _SAME * last)] if len(ends) else ends
    thin, growth = _AT_END_FINE
    return replace(circle, radii_m=np.unique(np.append(lines, ends)), sectors=max(circle.sectors, _AROUND),
                   thin_m=circle.thin_m * thin / _AT_END[0], growth=growth)


def _meets(circle: _Circle, loop: Array) -> bool:
    """Whether a closed polygon (n, 2) and a circle have points in common."""
    ends = np.roll(loop, -1, axis=0)
    return bool(inside(circle.centre_m, loop, ends)) or bool(
        squared_distance(circle.centre_m, loop, ends).min() <= circle.radii_m[-1] ** 2)


def _with_rings(around: Triangles, circles: list[_Circle]) -> tuple[Triangles, list[Indices]]:
    """The triangles with the rings that fill their circles, at whose corners these lie, and of each circle the numbers
    of its corners but the axis."""
    corners, cells, ringed = around.corners_m.copy(), [around.cells], []
    for k, circle in enumerate(circles):
        loop = np.unique(around.segments[around.marker == -1 - k])
        offset = corners[loop] - circle.centre_m
        angle = np.arctan2(offset[:, 1], offset[:, 0])
        loop, angle = loop[np.argsort(angle)], np.sort(angle)
        spoke = np.column_stack([np.cos(angle), np.sin(angle)])
        corners[loop] = circle.centre_m + circle.radii_m[-1] * spoke
        first = len(corners)
        number = np.vstack([first + 1 + np.arange((len(circle.radii_m) - 2) * len(loop)).reshape(-1, len(loop)), loop])
        within = circle.centre_m + (circle.radii_m[1:-1, None, None] * spoke).reshape(-1, 2)
        corners = np.vstack([corners, circle.centre_m, within])
        fan = np.column_stack([np.full(len(loop), first), number[0], np.roll(number[0], -1)])
        cells += [fan, ring_cells(number)]
        ringed.append(number.ravel())
    return replace(around, corners_m=corners, cells=np.vstack(cells)), ringed


def _curved(mesh: SkinMesh, circles: list[_Circle], ringed: list[Indices]) -> SkinMesh:
    """The mesh with the middles of its rings' sides on circles."""
    side = np.vstack([mesh.cells[:, list(nodes)] for nodes in EDGES])
    nodes = mesh.nodes_m.copy()
    for circle, own in zip(circles, ringed, strict=True):
        part = side[np.isin(side[:, 0], own) & np.isin(side[:, 1], own)]
        nodes[part[:, 2]] = turned(mesh.nodes_m[part[:, :2]], circle.centre_m)
    return replace(mesh, nodes_m=nodes)
