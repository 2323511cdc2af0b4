"""The complete electrode model of linear triangles by EIDORS' formulas, written out by themselves: not EIDORS.

They are those of its system_mat_1st_order and system_mat_fields: per triangle sigma A g g', g the gradients from the
inverse of [1 x y]; per edge under an electrode, length / z [1/3 1/6 -1/2; 1/6 1/3 -1/2; -1/2 -1/2 1] of its ends and
the electrode. Source: Adler and Lionheart, doi:10.1088/0967-3334/27/5/S03.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from eitsim.electrics.cem.assembly import SkinMesh
from touchcal.arrays import Array

_CONTACT = np.array([[1 / 3, 1 / 6, -1 / 2], [1 / 6, 1 / 3, -1 / 2], [-1 / 2, -1 / 2, 1.0]])


def impedance_by_eidors_formulas(mesh: SkinMesh, conductance_S: Array, contact_Ohm_m: Array) -> Array:
    """Impedance matrix (N, N), Ohm, of a mesh of linear triangles of conductances (cells,), S, by a sparse factor with
    the first node earthed."""
    nodes, count = len(mesh.nodes_m), mesh.count
    corners = np.concatenate([np.ones((len(mesh.cells), 3, 1)), mesh.nodes_m[mesh.cells]], axis=2)
    slope = np.linalg.inv(corners)[:, 1:]
    area = np.abs(np.linalg.det(corners)) / 2
    inner = (conductance_S * area)[:, None, None] * slope.swapaxes(1, 2) @ slope
    a, b = mesh.nodes_m[mesh.under].swapaxes(0, 1)
    outer = (np.linalg.norm(b - a, axis=1) / contact_Ohm_m[mesh.electrode])[:, None, None] * _CONTACT
    place = [mesh.cells, np.column_stack([mesh.under, nodes + mesh.electrode])]
    row, column = (np.concatenate([np.broadcast_to(p[:, :, None] if own else p[:, None], (len(p), 3, 3)).ravel()
                                   for p in place]) for own in (True, False))
    system = coo_matrix((np.concatenate([inner.ravel(), outer.ravel()]), (row, column))).tocsc()[1:, 1:]
    currents = np.zeros((nodes + count - 1, count))
    currents[-count:] = np.eye(count) - 1 / count
    voltage = splu(system).solve(currents)[-count:]
    return voltage - voltage.mean(axis=0)
