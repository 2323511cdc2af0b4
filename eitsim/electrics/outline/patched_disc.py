"""A mesh of a disc with patches at its rim that follows touches between and on them, where no ring of patches has room
outside the contacts."""

from collections.abc import Sequence

import numpy as np

from eitsim.electrics.cem.assembly import Array, SkinMesh
from eitsim.electrics.mesh.graded_mesh import LEAN, Touches
from eitsim.electrics.outline.touch_mesh import contact_circles, touched_sizes, within_edges
from eitsim.electrics.outline.triangles import EVEN, of_lines, refined, skin_mesh
from eitsim.scene.electrodes import Electrodes, arcs, lengths
from eitsim.scene.polygons import circle, squared_distance
from eitsim.scene.scene import Body

_CHORDS = 400  # Corners of the polygon that stands for the rim, with the ends of patches.
# Length of triangles at a patch over the shorter of its sides, its growth per unit of distance, the largest over the
# radius.
_AT_PATCH, _GROWTH, _LARGEST = 0.25, 0.5, 0.1
# Distance of a contact from the ring of patches, over their length, up to which this mesh is taken.
_NEAR = 0.05


def reaches_patches(body: Body, electrodes: Electrodes, touches: Touches) -> bool:
    """Whether a contact reaches the ring of patches, or nearly."""
    ring = (1 + _NEAR) * float(lengths(electrodes).max())
    return electrodes.at_rim and any(
        body.radius_m - float(np.hypot(punch.x_m, punch.y_m)) - max(punch.diameter_m / 2, touch.contact_radius_m) < ring
        for punch, touch in touches)


def patched_disc_mesh(body: Body, electrodes: Electrodes, touches: Touches) -> SkinMesh:
    """P2 mesh with lines at the patches' edges and the contacts'. ValueError where punches reach the rim, or contacts
    each other."""
    rim, patches = _lines(body, electrodes)
    starts, ends = np.vstack(patches), np.vstack([np.roll(loop, -1, axis=0) for loop in patches])
    within = within_edges(body, touches)
    sizes = touched_sizes(within)
    least = _AT_PATCH * min(float(lengths(electrodes).min()), float(np.min(electrodes.width_m)))

    def limit(places: Array) -> Array:
        away = np.sqrt(np.min([squared_distance(places, a, b) for a, b in zip(starts, ends, strict=True)], axis=0))
        size = np.minimum(least + _GROWTH * away, _LARGEST * body.radius_m)
        for (punch, _), (radius, here) in zip(touches, sizes, strict=True):
            off = np.hypot(places[:, 0] - punch.x_m, places[:, 1] - punch.y_m)
            size = np.minimum(size, np.interp(off, radius, here) + LEAN.growth * np.maximum(off - radius[-1], 0))
        return EVEN * size**2

    lines = [*patches, *contact_circles(within, sizes)]
    plain = of_lines([rim], np.ones(len(rim), dtype=np.int64), lines)
    return skin_mesh(refined(plain, limit), electrodes, patches=patches)


def _lines(body: Body, electrodes: Electrodes) -> tuple[Array, Sequence[Array]]:
    """The rim (n, 2), and the patches (n, 2) whose outer corners are some of its own."""
    ends = arcs(body.radius_m, electrodes)
    even = circle(np.zeros(2), body.radius_m, _CHORDS)
    radius, turn = float(np.linalg.norm(even[0])), 2 * np.pi
    angles = np.unique(np.round(np.mod(np.append(turn * np.arange(_CHORDS) / _CHORDS, ends), turn), 12))
    rim = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    patches = []
    for (first, last), length in zip(ends, lengths(electrodes), strict=True):
        own = np.flatnonzero(np.mod(angles - first + 1e-9, turn) <= last - first + 2e-9)
        own = own[np.argsort(np.mod(angles[own] - first + 1e-9, turn))]
        patches.append(np.vstack([rim[own], rim[own[::-1]] * (1 - length / radius)]))
    return rim, patches
