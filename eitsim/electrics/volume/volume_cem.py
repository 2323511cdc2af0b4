"""Complete electrode model of a volume on a given mesh: from conductivity to the electrodes' impedance matrix.

Direct currents alone. A touched body is solved on its reference mesh: there its conductivity is J F^-1 s F^-T.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.electrics.cem.assembly import joined, per_electrode, resolved
from eitsim.electrics.volume.volume_elements import reference
from eitsim.numerics.conductor_elimination import Detached, impedance_alone
from eitsim.numerics.nested_dissection import Dissection, dissect
from touchcal.arrays import Array

Indices = NDArray[np.integer]

_CHUNK = 500  # Cells whose matrices are made at a time.


@dataclass(frozen=True, eq=False)
class VolumeMesh:
    """A body cut into elements, and the faces of it that lie under electrodes; nodes in the order of
    `volume_elements`."""

    nodes_m: Array  # (n, 3) nodes, m; the elements are isoparametric
    cells: Indices  # (cells, k) node numbers of each element
    under: Indices  # (faces, m) node numbers of the faces under electrodes
    electrode: Indices  # (faces,) the electrode each of them lies under, from 0
    count: int  # how many electrodes
    element: str = "T1"  # T1 and T2: tetrahedra; P1xL1, P2xL2, Q2xL2: prisms
    face: str = "P1"  # of the faces: P1, P2, Q2, or L1xL1, L2xL2 of a prism's sides

    def __post_init__(self) -> None:
        bare = np.setdiff1d(np.arange(self.count), self.electrode)
        if bare.size:
            raise ValueError(f"electrode {bare[0]} (from 0) has no face of the mesh; give each at least one.")


def volume_points(mesh: VolumeMesh) -> Array:
    """Points (cells, q, 3), m, where the conductivity is needed."""
    return reference(mesh.element).value @ mesh.nodes_m[mesh.cells]


def volume_dissection(mesh: VolumeMesh) -> Dissection:
    """Order of elimination of nodes, then electrodes, that serves every conductivity; across the plane, as layers are
    thin."""
    blocks = [mesh.cells, np.column_stack([mesh.under, len(mesh.nodes_m) + mesh.electrode])]
    return dissect(mesh.nodes_m[mesh.cells].mean(axis=1)[:, :2], blocks, mesh.count)


def volume_impedance(mesh: VolumeMesh, conductivity_S_per_m: ArrayLike, contact_impedance_Ohm_m2: ArrayLike, *,
                     order: Dissection | None = None) -> Array:
    """Impedance matrix Z of a body's electrodes: U = Z I of int grad v . s grad u + (1/z) int (v - V)(u - U).

    Parameters
    ----------
    mesh
        The body and its electrodes' faces.
    conductivity_S_per_m
        (cells,) or (cells, q) where isotropic, (cells, q, 3, 3) where a tensor, S/m, at the `volume_points`.
    contact_impedance_Ohm_m2
        One number, or (count,) one an electrode, Ohm m^2.
    order
        An order of elimination of `volume_dissection`, where one is at hand.

    Returns
    -------
    Array
        (count, count), Ohm, for currents that sum to zero; rows and columns sum to zero.

    Raises
    ------
    ValueError
        Where an element is folded over, a conductivity or contact impedance is not positive, or a part is joined to no
        electrode. Source: Somersalo, Cheney, Isaacson, doi:10.1137/0152060.
    """
    sigma, z = np.asarray(conductivity_S_per_m, dtype=float), per_electrode(mesh.count, contact_impedance_Ohm_m2)
    local = _contacts(mesh) / z[mesh.electrode, None, None]
    weights = np.concatenate([*_stiffness(mesh, sigma), _pairs(local).ravel()])
    order = volume_dissection(mesh) if order is None else order
    try:
        return resolved(impedance_alone(order, weights, mesh.count))
    except Detached as lost:
        raise ValueError(f"the body is torn: no current flows between unknown {lost.unknown} of {len(mesh.nodes_m)} "
                         f"nodes and electrode {mesh.count - 1} (from 0); join its parts.") from None


def _stiffness(mesh: VolumeMesh, sigma: Array) -> Iterator[Array]:
    """Weights (pairs,) of int grad v . s grad u, chunk by chunk of cells."""
    shape = reference(mesh.element)
    for start in range(0, len(mesh.cells), _CHUNK):
        part = slice(start, start + _CHUNK)
        jacobian = np.einsum("cka,qkb->cqab", mesh.nodes_m[mesh.cells[part]], shape.gradient)
        volume = np.linalg.det(jacobian)
        if not np.all(volume * np.sign(volume[:, :1]) > 0):
            raise ValueError("the mesh has an element that is flat or folded over; check the order of its nodes.")
        slope = shape.gradient @ np.linalg.inv(jacobian)
        flow = slope @ _tensors(sigma[part], volume.shape)
        flow *= (shape.weights * np.abs(volume))[..., None, None]
        k = slope.shape[2]
        yield _pairs(flow.swapaxes(1, 2).reshape(len(slope), k, -1)
                     @ slope.swapaxes(1, 2).reshape(len(slope), k, -1).swapaxes(1, 2)).ravel()


def _tensors(sigma: Array, shape: tuple[int, ...]) -> Array:
    """(cells, q, 3, 3), checked to be positive definite."""
    if sigma.ndim < 4:
        sigma = (sigma[:, None] if sigma.ndim == 1 else sigma)[..., None, None] * np.eye(3)
    if not np.all(np.linalg.eigvalsh(sigma)[..., 0] > 0):
        raise ValueError("the conductivity must be positive (definite) and finite everywhere.")
    return np.broadcast_to(sigma, (*shape, 3, 3))


def _pairs(local: Array) -> Array:
    """Weights (parts, pairs) of local matrices (parts, k, k) whose rows sum to zero."""
    return -local[:, *np.triu_indices(local.shape[1], 1)]


def _contacts(mesh: VolumeMesh) -> Array:
    """Local matrices (faces, m + 1, m + 1) of int (v - V)(u - U), the electrode's own potential last."""
    shape = reference(mesh.face)
    tangents = np.einsum("fka,qkb->fqab", mesh.nodes_m[mesh.under], shape.gradient)
    area = shape.weights * np.linalg.norm(np.cross(tangents[..., 0], tangents[..., 1]), axis=-1)
    return joined(shape.value, area)
