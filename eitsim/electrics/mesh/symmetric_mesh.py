"""Equal meshes for scenes that a turn or a mirror of the ring of electrodes takes into each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from eitsim.electrics.cem.assembly import SkinMesh
from eitsim.electrics.cem.ring_scattering import position
from eitsim.electrics.mesh.contact_line import with_contact_lines
from eitsim.electrics.mesh.graded_mesh import LEAN, triangulation
from eitsim.electrics.mesh.p2_triangles import with_quarter_points
from eitsim.scene.electrodes import Electrodes, identical
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch

# Places are rounded to this length, m, so that rounding in a turn changes no triangle.
_PLACE_M = 1e-9


def alike_mesh(body: Body, electrodes: Electrodes, touches: tuple[tuple[Punch, Touch], ...],
               level: int = 1, thinner: int = 1) -> SkinMesh:
    """As a lean `triangulation`, `with_contact_lines` and `with_quarter_points`.

    Where the electrodes are alike it is made with the first touch at an angle of 0 to half a step from the first
    electrode, then turned and mirrored back: equal scenes have equal errors.
    """
    if not identical(electrodes):
        return _lean(body, electrodes, touches, level, thinner)
    step, first = 2 * np.pi / electrodes.count, position(touches[0][0])
    turns = round((np.angle(first) - electrodes.first_angle_rad) / step)
    turn = np.exp(1j * (electrodes.first_angle_rad + turns * step))
    mirrored = bool((first / turn).imag < -_PLACE_M / 2)
    local = [position(punch) / turn for punch, _ in touches]
    local = [z.conjugate() if mirrored else z for z in local]
    moved = tuple((replace(punch, x_m=_rounded(z.real), y_m=_rounded(z.imag)), touch)
                  for (punch, touch), z in zip(touches, local, strict=True))
    even = replace(electrodes, first_angle_rad=0.0)
    mesh = _lean(body, even, moved, level, thinner)
    nodes = mesh.nodes_m @ np.array([1, 1j])
    nodes = (nodes.conj() if mirrored else nodes) * turn
    electrode = ((-1 if mirrored else 1) * mesh.electrode + turns) % electrodes.count
    return replace(mesh, nodes_m=np.column_stack([nodes.real, nodes.imag]), electrode=electrode)


def _lean(body: Body, electrodes: Electrodes, touches: tuple[tuple[Punch, Touch], ...], level: int,
          thinner: int) -> SkinMesh:
    mesh = triangulation(body, electrodes, touches, level, thinner, grading=LEAN)
    return with_quarter_points(with_contact_lines(mesh, body, electrodes, touches))


def _rounded(length_m: float) -> float:
    return round(length_m / _PLACE_M) * _PLACE_M
