"""A mesh of a skin with an outline that follows its touches: lines at their contacts, triangles as small as needed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from eitsim.electrics.cem.assembly import Array, SkinMesh
from eitsim.electrics.mesh.graded_mesh import LEAN, Touches
from eitsim.electrics.mesh.ring_mesh import FARTHEST, centred_radii, contact_lines
from eitsim.electrics.outline.adapted_mesh import READINGS, solve_untouched
from eitsim.electrics.outline.triangles import EVEN, Triangles, refined, skin_mesh, triangulated
from eitsim.scene.polygons import circle
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch

Within = tuple[Punch, Touch, float]

FIELDS = 1e-3  # Estimated error of the untouched readings from which the mesh is fine enough outside the touches.
# Length of the triangles' sides over the width of the rings that an axisymmetric mesh would have there.
_STRETCHED = 3.0


def touch_mesh(body: Body, electrodes: Electrodes, conductance_S: float, touches: Touches) -> SkinMesh:
    """P2 mesh with circles at the punches' edges, the starts of their fillets and the ends of contact.

    Outside the touches its triangles are as small as those on which the readings of the untouched skin are known to
    FIELDS. ValueError where punches reach an edge, or contacts each other.
    """
    base = base_triangles(body, electrodes, conductance_S)
    known, area = KDTree(base.centres_m), base.area_m2
    within = within_edges(body, touches)
    sizes = touched_sizes(within)

    def limit(places: Array) -> Array:
        out = area[known.query(places)[1]]
        for (punch, _), (radius, size) in zip(touches, sizes, strict=True):
            away = np.hypot(places[:, 0] - punch.x_m, places[:, 1] - punch.y_m)
            here = np.interp(away, radius, size) + LEAN.growth * np.maximum(away - radius[-1], 0)
            out = np.minimum(out, EVEN * here**2)
        return out

    lines = contact_circles(within, sizes)
    return skin_mesh(refined(triangulated(body.outline, electrodes, lines), limit), electrodes)


def fields_mesh(body: Body, electrodes: Electrodes, conductance_S: float, area_m2: float,
                known_to: float = FIELDS) -> SkinMesh:
    """P2 mesh on which the readings of the untouched skin are known to such a relative error, its triangles of an area,
    m^2, at most."""
    base = base_triangles(body, electrodes, conductance_S, known_to)
    return skin_mesh(refined(base, lambda places_m: np.full(len(places_m), area_m2)), electrodes)


def base_triangles(body: Body, electrodes: Electrodes, conductance_S: float, known_to: float = FIELDS) -> Triangles:
    """Triangles on which the readings of the untouched skin are known to such a relative error."""
    history = solve_untouched(body.outline, electrodes, conductance_S, min(known_to, READINGS)).history
    return next(mesh for mesh, error in history if error <= known_to)


def within_edges(body: Body, touches: Touches) -> list[Within]:
    """Punches, their touches with the ends of contact on the skin, and the distance, m, from each contact to the
    nearest edge or to the middle of the way to another; ValueError where a punch reaches an edge, or contacts meet."""
    place = np.array([[punch.x_m, punch.y_m] for punch, _ in touches])
    inner = np.array([punch.diameter_m / 2 for punch, _ in touches])
    room = body.edge.gap_m(place) - inner
    reach = np.maximum(inner, [touch.contact_radius_m for _, touch in touches])
    separation = np.linalg.norm(place[:, None] - place, axis=-1) - np.add.outer(reach, reach)
    np.fill_diagonal(separation, np.inf)
    if room.min() <= 0 or separation.min() <= 0:
        raise ValueError("a punch reaches an edge of the skin, or its contact another one; leave a gap.")
    inside = [replace(touch, contact_radius_m=min(touch.contact_radius_m, float(own + FARTHEST * gap)))
              for (_, touch), own, gap in zip(touches, inner, room, strict=True)]
    ends = np.maximum(inner, [touch.contact_radius_m for touch in inside])
    gaps = np.minimum(inner + room - ends, separation.min(axis=1) / 2)
    return [(punch, touch, float(gap)) for (punch, _), touch, gap in zip(touches, inside, gaps, strict=True)]


def touched_sizes(within: Sequence[Within]) -> list[tuple[Array, Array]]:
    """Radii about each punch, m, and the length of the triangles' sides there, m."""
    return [_sizes(*one) for one in within]


def contact_circles(within: Sequence[Within], sizes: Sequence[tuple[Array, Array]]) -> list[Array]:
    """The circles (n, 2), m, of all contacts."""
    return [circle((punch.x_m, punch.y_m), mark, _chords(mark, *own))
            for (punch, touch, _), own in zip(within, sizes, strict=True) for mark in contact_lines(punch, touch)]


def _sizes(punch: Punch, touch: Touch, gap: float) -> tuple[Array, Array]:
    """Radii about a punch, m, and the length of the triangles' sides there, m."""
    radii = centred_radii(punch, touch, gap, 1, 1, LEAN.steepest)
    return (radii[1:] + radii[:-1]) / 2, _STRETCHED * np.diff(radii)


def _chords(mark: float, radius: Array, size: Array) -> int:
    return max(LEAN.sectors, int(np.ceil(2 * np.pi * mark / np.interp(mark, radius, size))))
