"""A mesh of a skin with an outline with rings of curved triangles about its touches, thin where these are steep."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from eitsim.electrics.mesh.graded_mesh import LEAN, Touches, ring_cells, turned
from eitsim.electrics.mesh.p2_triangles import EDGES, straight, untangled, with_quarter_points
from eitsim.electrics.mesh.ring_mesh import centred_radii
from eitsim.electrics.outline.touch_mesh import EVEN, FIELDS, base_triangles, touch_mesh, within_edges
from eitsim.electrics.outline.triangles import Triangles, refined, skin_mesh, triangulated
from eitsim.scene.outline import inside, squared_distance
from eitsim.scene.outline_electrodes import patch_loops
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch

_SIDE = 2.0  # Length of triangles along the outermost circle, at least, over the fillet radius, of rings not thinner.
_SAME = 1e-4  # Radii closer than this share of the outermost one are one.
_THINNER = 4  # Rings are so many times thinner than those of a mesh of quadrilaterals (`template`), unless given.


@dataclass(frozen=True, eq=False)
class _Circle:
    """Rings about a punch."""

    centre_m: Array  # (2,) axis, m
    radii_m: Array  # (rings + 1,) radii from 0, m
    sectors: int  # triangles around, about

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
    each punch as far as half the way to the nearest edge; `touch_mesh` where an electrode on the surface lies there.

    Outside, its triangles are as small as those on which the readings of the untouched skin are known to such a
    relative error; middle nodes lie at a quarter of the way from the ends of line electrodes. Rings end at the samples
    of the touch, and of what edges change of it, too where it is asked for. ValueError where punches reach an edge, or
    contacts each other.
    """
    circles = [_circle(punch, touch, gap, thinner) for punch, touch, gap in within_edges(body, touches)]
    if at_samples:
        circles = [_at_samples(circle, touch) for circle, (_, touch) in zip(circles, touches, strict=True)]
    if electrodes.kind == "surface" and any(_meets(circle, loop) for circle in circles
                                            for loop in patch_loops(electrodes)):
        return touch_mesh(body, electrodes, conductance_S, touches)
    base = base_triangles(body, electrodes, conductance_S, known_to)
    known, area = KDTree(base.centres_m), base.area_m2

    def limit(mesh: Triangles) -> Array:
        places = mesh.centres_m
        out = area[known.query(places)[1]]
        for circle in circles:
            away = np.linalg.norm(places - circle.centre_m, axis=1) - circle.radii_m[-1]
            out = np.minimum(out, EVEN * (circle.size_m + LEAN.growth * np.maximum(away, 0)) ** 2)
        return out

    around = refined(triangulated(body, electrodes, left_out=[circle.loop_m for circle in circles]), limit)
    whole, ringed = _with_rings(around, circles)
    mesh = skin_mesh(whole, electrodes)
    return with_quarter_points(untangled(_curved(mesh, circles, ringed), straight(mesh)))


def _circle(punch: Punch, touch: Touch, gap: float, thinner: int) -> _Circle:
    radii = centred_radii(punch, touch, gap, thinner, 1, LEAN.steepest)
    around = 2 * np.pi * radii[-1] / (LEAN.stretched * max(np.diff(radii)[-3:].max(), _SIDE * punch.fillet_m / thinner))
    return _Circle(np.array([punch.x_m, punch.y_m]), radii, max(LEAN.sectors, int(np.ceil(around))))


def _at_samples(circle: _Circle, touch: Touch) -> _Circle:
    """The circle with rings that end at the touch's samples too; ends that all but coincide are one."""
    edges = touch.rim.radius_m if touch.rim is not None else np.empty(0)
    ends, last = np.concatenate([circle.radii_m, touch.radius_m, edges]), circle.radii_m[-1]
    ends = np.unique(np.append(ends[(ends >= 0) & (ends < (1 - _SAME) * last)], last))
    return replace(circle, radii_m=ends[np.append(True, np.diff(ends) > _SAME * last)])


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
