"""How far signals of a nominal skin differ by two fields that change an axisymmetric touch, or by two surfaces.

The skin's conductivity is c(e) = exp(-2 e). For fields its sensor is the default one in proportion to the disc: which
of them a scene has is not known where tables are made. The sensor matters little: drive, contact impedance and width of
electrodes by a fifth at most. The law matters where it is far from the paper's: for one touch, driven by the normal
strain, the real difference was 1.07 times this for 1 - 2 e + 2 e^2 - e^3, 0.9 for 1 + e, and 4.6 for 1 - e / 2.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import Array, SkinMesh, dissection, impedance, quadrature_points
from eitsim.electrics.forward.skins import skin_of
from eitsim.electrics.mesh.symmetric_mesh import alike_mesh
from eitsim.scene.drive import read_out
from eitsim.scene.electrodes import Electrodes, among_all, contact_impedances, present
from eitsim.scene.polygons import Edges, inside
from eitsim.scene.results import RimField, SurfaceField, Touch
from eitsim.scene.scene import STRAINS, Body, Drive, Punch
from eitsim.sheet.sheet_conductance import driving_strains, surface_metric
from touchcal.errors import NotConverged

_SENSITIVITY = -2.0  # c(e) = exp(_SENSITIVITY e).
_DEFAULT_S = 6e-4  # Conductance, S, of the default skin, which the contact impedance is in proportion to.
# Bearings of the touch from an electrode, over half the step between electrodes: a difference grows up to tenfold from
# one to another, and mostly counts most between electrodes.
_BEARINGS = (0.0, 0.5, 1.0)


def signal_differences(body: Body, punch: Punch, touch: Touch, rough: RimField, field: RimField,
                       edges: Edges | None = None) -> Array:
    """(3,) relative difference, 2-norm, of the signals dV by a touch with either field, of a skin driven by each of
    scene.STRAINS, at the bearing from an electrode where it is largest; infinite where a field leaves no skin (its
    metric is not positive), or no bearing has a mesh of the skin. edges: closed polygons, outside which neither field
    counts."""
    size, given = body.radius_m / Body().radius_m, Electrodes()
    width, impedance_Ohm_m = (float(np.mean(part)) for part in (given.width_m, given.contact_impedance_Ohm_m))
    electrodes = replace(given, width_m=width * size, contact_impedance_Ohm_m=impedance_Ohm_m * _DEFAULT_S * size)
    touches = [replace(touch, rim=part) for part in (rough, field)]
    half_step, bearing = np.pi / electrodes.count, np.arctan2(punch.y_m, punch.x_m)
    found = []
    for share in _BEARINGS:
        with contextlib.suppress(NotConverged):
            turned, turn = _turned(punch, touches, share * half_step - bearing), _turn(share * half_step - bearing)
            within = None if edges is None else (edges[0] @ turn.T, edges[1] @ turn.T)
            mesh = alike_mesh(body, electrodes, ((turned[0], turned[1][-1]),))
            found.append(_differences(mesh, electrodes, Drive(), *turned, within))
    return np.max(found, axis=0) if found else np.full(len(STRAINS), np.inf)


def surface_differences(body: Body, electrodes: Electrodes, drive: Drive, touches: Sequence[tuple[Punch, Touch]],
                        rough: SurfaceField) -> Array:
    """(3,) as `signal_differences`, of a sensor's signals by touches that share one surface and by a rough one."""
    mesh = skin_of(body, present(electrodes), _DEFAULT_S).touch_mesh(tuple(touches))
    (punch, touch), *_ = touches
    return _differences(mesh, electrodes, drive, punch, [replace(touch, surface=rough), touch], None, _DEFAULT_S)


def _turned(punch: Punch, touches: list[Touch], angle: float) -> tuple[Punch, list[Touch]]:
    """A punch and its touches, turned about the disc's centre."""
    turn = _turn(angle)
    x, y = (turn @ [punch.x_m, punch.y_m]).tolist()
    out = []
    for touch in touches:
        assert touch.rim is not None
        towards = touch.rim.towards
        out.append(touch if towards is None else replace(touch, rim=replace(touch.rim, towards=turn @ towards)))
    return replace(punch, x_m=x, y_m=y), out


def _turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _differences(mesh: SkinMesh, electrodes: Electrodes, drive: Drive, punch: Punch, touches: list[Touch],
                 edges: Edges | None, rest_S: float = 1.0) -> Array:
    """Of a rough touch and a fine one, on a skin whose conductance at rest is rest_S."""
    z, order = contact_impedances(present(electrodes)), dissection(mesh)
    untouched = impedance(mesh, np.full(len(mesh.cells), rest_S), z, order=order)
    places = quadrature_points(mesh) - np.array([punch.x_m, punch.y_m])
    on_skin = np.bool_(True) if edges is None else inside(places, *edges)
    found = []
    for touch in touches:
        sheets = _conductances(mesh, punch, touch, on_skin)
        if sheets is None:
            return np.full(len(STRAINS), np.inf)
        changes = [impedance(mesh, rest_S * sheet, z, order=order) - untouched for sheet in sheets]
        found.append([read_out(drive, among_all(electrodes, change)).ravel() for change in changes])
    rough, fine = np.nan_to_num(found)
    signal, separation = np.linalg.norm(fine, axis=1), np.linalg.norm(fine - rough, axis=1)
    return np.where(separation > 0, separation / np.where(separation > 0, signal, 1.0), 0.0)


def _conductances(mesh: SkinMesh, punch: Punch, touch: Touch, on_skin: NDArray[np.bool_] | np.bool_) -> Array | None:
    """(3, cells, q, 2, 2) conductance tensors of the nominal skin over those at rest, by STRAINS, at rest off the skin;
    None where the metric is no metric."""
    metric, normal = surface_metric(quadrature_points(mesh), punch, touch)
    metric = np.where(np.asarray(on_skin)[..., None, None], metric, np.eye(2))
    normal = np.where(on_skin, normal, 1.0)
    xx, xy, yy = metric[..., 0, 0], metric[..., 0, 1], metric[..., 1, 1]
    square = xx * yy - xy**2
    if not (np.all(square > 0) and np.all(xx > 0) and np.all(normal > 0)):
        return None
    areal = np.sqrt(square)
    first = np.sqrt((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))
    sheet = np.exp(_SENSITIVITY * driving_strains(first, areal / first, normal)) / areal
    return np.stack([sheet * yy, -sheet * xy, -sheet * xy, sheet * xx], axis=-1).reshape(-1, *metric.shape)
