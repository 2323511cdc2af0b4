"""Fields of the electrodes of an untouched sheet in space, at places spread over it."""

from dataclasses import dataclass

import numpy as np

from eitsim.electrics.cem.assembly import Array, centred, potentials, tangent_axes
from eitsim.electrics.curved.adapted_sheet import skin_mesh, solve_sheet
from eitsim.electrics.curved.facets import slopes
from eitsim.electrics.curved.solve_curved import contact_impedances, prepared, uniform
from eitsim.scene.curved_skin import CurvedSkin
from eitsim.scene.surfaces.curved_surface import tangent_frame

_MIDDLE = np.array([1.0, 1.0]) / 3  # of a triangle


@dataclass(frozen=True, eq=False)
class UntouchedFields:
    """Potentials' slopes over a sheet, of 1 A into each electrode in turn and out of all of them evenly."""

    points_m: Array  # (n, 3) m
    frames: Array  # (n, 3, 3) two tangents and the normal, in rows, as `tangent_frame`
    slopes: Array  # (n, 2, electrodes) along both tangents, V/m
    impedance_Ohm: Array  # (electrodes, electrodes)


def untouched_fields(skin: CurvedSkin, count: int, readings: float) -> UntouchedFields:
    """The fields of a sheet at about `count` places, its readings as exact as asked, relative; ValueError and
    NotConverged as `solve_curved_skin`."""
    z = contact_impedances(skin)
    found = solve_sheet(prepared(skin), z, uniform(skin.conductance_S), None, readings, np.inf)
    mesh = skin_mesh(found.facets, skin.count)
    nodes = mesh.nodes_m[mesh.cells]
    potential = centred(mesh, potentials(mesh, np.full(len(mesh.cells), skin.conductance_S), z))
    one, other = np.einsum("tkx,kb->btx", nodes, slopes(_MIDDLE))
    middles = nodes[:, 3:].mean(axis=1)
    area = float(np.linalg.norm(np.cross(one, other), axis=1).sum() / 2)
    cells = np.unique(np.floor(middles / np.sqrt(area / count)), axis=0, return_index=True)[1]  # one in each cube
    along = np.stack([one, other], axis=-1)[cells]
    by_reference = np.einsum("tke,kb->tbe", potential[mesh.cells[cells]], slopes(_MIDDLE))
    space = along @ np.linalg.solve(np.swapaxes(along, 1, 2) @ along, by_reference)
    frames = np.stack([tangent_frame(normal) for normal in tangent_axes(one[cells], other[cells])[..., 2]])
    return UntouchedFields(middles[cells], frames, frames[:, :2] @ space, found.impedance_Ohm)
