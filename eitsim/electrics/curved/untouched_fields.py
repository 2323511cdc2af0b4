"""Fields of the electrodes of an untouched sheet in space, at places spread over it."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix

from eitsim.electrics.cem.assembly import Array, centred, potentials
from eitsim.electrics.curved.adapted_sheet import solve_sheet
from eitsim.electrics.curved.facets import functions, slopes
from eitsim.electrics.curved.solve_curved import contact_impedances, prepared, uniform
from eitsim.scene.curved_skin import CurvedSkin
from eitsim.scene.surfaces.curved_surface import tangent_frame

# Places of a triangle, the middles of the four that its halving makes.
_PLACES = np.array([[1.0, 1.0], [4.0, 1.0], [1.0, 4.0], [2.0, 2.0]]) / [[3.0], [6.0], [6.0], [6.0]]


@dataclass(frozen=True, eq=False)
class UntouchedFields:
    """Potentials' slopes over a sheet, of 1 A into each electrode in turn and out of all of them evenly."""

    points_m: Array  # (n, 3) m
    areas_m2: Array  # (n,) of the sheet that each stands for, m^2
    frames: Array  # (n, 3, 3) two tangents and the normal, in rows, as `tangent_frame`
    slopes: Array  # (n, 2, electrodes) along both tangents, V/m
    impedance_Ohm: Array  # (electrodes, electrodes)


def untouched_fields(skin: CurvedSkin, count: int, readings: float) -> UntouchedFields:
    """Means of the fields of a sheet over parts of it, about `count`, its readings as exact as asked, relative;
    ValueError and NotConverged as `solve_curved_skin`."""
    z = contact_impedances(skin)
    found = solve_sheet(prepared(skin), z, uniform(skin.conductance_S), None, readings, np.inf)
    mesh = found.mesh
    nodes = mesh.nodes_m[mesh.cells]
    potential = centred(mesh, potentials(mesh, np.full(len(mesh.cells), skin.conductance_S), z))
    along = np.einsum("tkx,qkb->tqxb", nodes, slopes(_PLACES))
    by_reference = np.einsum("tke,qkb->tqbe", potential[mesh.cells], slopes(_PLACES), optimize=True)
    space = along @ np.linalg.solve(np.swapaxes(along, -1, -2) @ along, by_reference)
    turn = np.cross(along[..., 0], along[..., 1])
    area = np.linalg.norm(turn, axis=-1) / (2 * len(_PLACES))
    points = np.einsum("tkx,qk->tqx", nodes, functions(_PLACES)).reshape(-1, 3)
    part = np.unique(np.floor(points / np.sqrt(area.sum() / count)), axis=0, return_inverse=True)[1].ravel()
    total = coo_matrix((area.ravel(), (part, np.arange(len(part))))).tocsr()
    areas = np.asarray(total.sum(axis=1)).ravel()

    def means(values: Array) -> Array:
        return (total @ values.reshape(len(part), -1)).reshape(len(areas), *values.shape[2:]) / areas.reshape(
            -1, *(1,) * (values.ndim - 2))

    normals = means(turn / np.linalg.norm(turn, axis=-1, keepdims=True))
    frames = np.stack([tangent_frame(normal / np.linalg.norm(normal)) for normal in normals])
    return UntouchedFields(means(points.reshape(*along.shape[:3])), areas, frames, frames[:, :2] @ means(space),
                           found.impedance_Ohm)
