"""Adjoint sensitivities of the electrodes' impedance matrix, and of the readings, which are linear in it.

With u_k the potential for 1 A into electrode k and 1/N A out of every one, the complete electrode model gives
dZ_kl = -int grad u_k . dS grad u_l - int d(1/z) (u_k - U_k)(u_l - U_l): all derivatives cost one solution.
Source: Polydorides, Lionheart, Meas. Sci. Technol. 13 (2002) 1871, DOI 10.1088/0957-0233/13/12/310.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh, contacts, gradients
from eitsim.scene.drive import read_out
from eitsim.scene.scene import Drive


def impedance_by_conductance(mesh: SkinMesh, potential: Array, region: Indices | None = None) -> Array:
    """dZ/dS_r (regions, N, N), Ohm/S: -int grad u_k . grad u_l over each region of isotropic sheet conductance.

    potential is that of cem.potentials; region (cells, q) numbers the mesh's quadrature points from 0, by default by
    cell.
    """
    gradient, area = gradients(mesh, potential[:len(mesh.nodes_m)])
    if region is None:
        region = np.broadcast_to(np.arange(len(mesh.cells))[:, None], area.shape)
    points, count = area.size, mesh.count
    regions = int(region.max()) + 1
    gather = csr_matrix((area.ravel(), (region.ravel(), np.arange(points))), shape=(regions, points))
    x, y = np.moveaxis(gradient.reshape(points, 2, count), 1, 0)
    return np.stack([-(gather @ (x[:, k, None] * x)) - gather @ (y[:, k, None] * y) for k in range(count)], axis=1)


def impedance_by_field(mesh: SkinMesh, potential: Array, change_S: Array) -> Array:
    """dZ/dp (N, N) of a parameter that changes the conductance tensor by dS/dp, (cells, q, 2, 2) at
    cem.quadrature_points; the unit is Ohm/S times that of dS/dp."""
    gradient, area = gradients(mesh, potential[:len(mesh.nodes_m)])
    flow = area[..., None, None] * (change_S @ gradient)
    return -gradient.reshape(-1, mesh.count).T @ flow.reshape(-1, mesh.count)


def impedance_by_contact(mesh: SkinMesh, potential: Array, contact_impedance: ArrayLike) -> Array:
    """dZ/dz_e (N, N, N), e first: 1/z_e^2 int (u_k - U_k)(u_l - U_l) under electrode e; 1/m under lines, 1/m^2 under
    patches. The contact impedance is one number or (N,), one an electrode."""
    z = np.broadcast_to(np.asarray(contact_impedance, dtype=float), mesh.count)[mesh.electrode]
    local = potential[np.column_stack([mesh.under, len(mesh.nodes_m) + mesh.electrode])]
    tied = contacts(mesh) / z[:, None, None]**2 @ local
    own = [mesh.electrode == k for k in range(mesh.count)]
    return np.stack([np.tensordot(local[part], tied[part], ((0, 1), (0, 1))) for part in own])


def readings_by(drive: Drive, impedance_by: Array) -> Array:
    """Derivatives of the readings (readings, p), V a unit, from those of the impedance matrix (p, N, N)."""
    return np.column_stack([read_out(drive, one).ravel() for one in impedance_by])
