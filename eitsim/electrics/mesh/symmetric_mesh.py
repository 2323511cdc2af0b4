"""Equal meshes for scenes that a turn or a mirror of the ring of electrodes takes into each other, the end of contact a
line of the mesh where a circle has no room inside the rim."""

from dataclasses import replace

import numpy as np

from eitsim.electrics.cem.assembly import SkinMesh
from eitsim.electrics.cem.ring_scattering import position
from eitsim.electrics.mesh.graded_mesh import LEAN, triangulation
from eitsim.electrics.mesh.p2_triangles import straight, untangled, with_quarter_points
from eitsim.electrics.mesh.ring_mesh import inside_rim, patch_radii
from eitsim.scene.electrodes import Electrodes, identical
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch
from touchcal.arrays import Complex

Touches = tuple[tuple[Punch, Touch], ...]

_PLACE_M = 1e-9  # Places are rounded to this length, m, so that rounding in a turn changes no triangle.
# The elements outside a contact give way on this part of its radius, or of the way to the contact of a neighbour.
_GIVES_WAY = 0.5


def alike_mesh(body: Body, electrodes: Electrodes, touches: Touches,
               level: int = 1, thinner: int = 1) -> SkinMesh:
    """As a lean `triangulation`, `with_contact_lines` and `with_quarter_points`.

    Where the electrodes are identical it is made with the first touch at an angle of 0 to half a step from the first
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
    even = replace(electrodes, first_angle_rad=0.0, clockwise=False)
    mesh = _lean(body, even, moved, level, thinner)
    nodes = mesh.nodes_m @ np.array([1, 1j])
    nodes = (nodes.conj() if mirrored else nodes) * turn
    electrode = (-1 if electrodes.clockwise else 1) * ((-1 if mirrored else 1) * mesh.electrode + turns)
    return replace(mesh, nodes_m=np.column_stack([nodes.real, nodes.imag]), electrode=electrode % electrodes.count)


def _lean(body: Body, electrodes: Electrodes, touches: Touches, level: int,
          thinner: int) -> SkinMesh:
    mesh = triangulation(body, electrodes, touches, level, thinner, grading=LEAN)
    return with_quarter_points(with_contact_lines(mesh, body, electrodes, touches))


def _rounded(length_m: float) -> float:
    return round(length_m / _PLACE_M) * _PLACE_M


def with_contact_lines(mesh: SkinMesh, body: Body, electrodes: Electrodes,
                       touches: Touches) -> SkinMesh:
    """The P2 mesh with the circles that `triangulation` draws inside the rim, where contacts reach it or nearly do,
    moved out along their radii to the end of contact, or to the same part of the way to the rim where that is nearer.

    The strain falls steeply at the end of contact all around the punch, so that elements across it cost 0.3 per cent of
    dV where the rim cuts the contact nearby. Corners on the rim and what lies inside the punches' edges stay; meshes of
    other touches are given back as they are. NotConverged as `untangled`.
    """
    radii = patch_radii(body, electrodes)
    nodes = mesh.nodes_m[:, 0] + 1j * mesh.nodes_m[:, 1]
    moved = nodes
    for k, (punch, touch) in enumerate(touches):
        drawn = inside_rim(punch, touch, radii)[0].contact_radius_m
        if drawn < touch.contact_radius_m:
            own = touch.contact_radius_m
            separation = [
                abs(position(punch) - position(other)) - own - max(other.diameter_m / 2, pressed.contact_radius_m)
                for other, pressed in (*touches[:k], *touches[k + 1:])]
            moved = _moved_out(moved, punch, touch, drawn, float(radii[0]), own + _GIVES_WAY * min([own, *separation]))
    if moved is nodes:
        return mesh
    line = replace(mesh, nodes_m=np.column_stack([moved.real, moved.imag]))
    return untangled(line, straight(line))


def _moved_out(nodes: Complex, punch: Punch, touch: Touch, drawn: float, rim: float, outside: float) -> Complex:
    """Nodes (n,), m, on the radii of the touch: its circle `drawn` goes to the end of contact, what lies between the
    punch's edge and the radius `outside`, from which on nodes stay, or the rim in proportion."""
    edge, centre = punch.diameter_m / 2, position(punch)
    away = np.abs(nodes - centre)
    along = np.divide(nodes - centre, away, out=np.ones_like(nodes), where=away > 0)
    across = (np.conj(centre) * along).real
    to_rim = np.sqrt(rim**2 - abs(centre)**2 + across**2) - across
    share = (drawn - edge) / (rim - abs(centre) - edge)
    line = np.minimum(touch.contact_radius_m, edge + share * (to_rim - edge))
    last = np.minimum(to_rim, outside)
    inner = edge + (away - edge) * (line - edge) / (drawn - edge)
    outer = last - (last - away) * (last - line) / (last - drawn)
    radius = np.where(away <= drawn, inner, outer)
    return np.where((away > edge) & (away < last), centre + radius * along, nodes)
