"""Complete electrode model on a given mesh: from sheet conductance to the impedance matrix of the electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_matrix
from skfem import ElementLineP1, ElementLineP2, ElementQuad2, ElementTriP1, ElementTriP2
from skfem.quadrature import get_quadrature

from eitsim.linear import Factorise, factorise

Array = NDArray[np.float64]
Indices = NDArray[np.integer]

ELEMENTS = ("P1", "P2", "Q2")
# element, degree of exactness of its quadrature, element of its edges
_KINDS = {"P1": (ElementTriP1, 1, ElementLineP1), "P2": (ElementTriP2, 4, ElementLineP2),
          "Q2": (ElementQuad2, 5, ElementLineP2)}
# Degree of exactness of the quadrature over areas under patches.
_AREA_DEGREE = 6


@dataclass(frozen=True, eq=False)
class SkinMesh:
    """The skin's reference surface cut into elements, and what of it lies under electrodes: edges under lines, whole
    elements under patches."""

    # (n, 2) nodes, m; the elements are isoparametric, so middle nodes may lie on curves
    nodes_m: Array
    # (cells, k) node numbers of each element, in scikit-fem's local order of degrees of freedom
    cells: Indices
    # (parts, m) node numbers of the edges under electrodes, m = 2 or 3: both ends, then the middle where the element
    # has one; or of the elements under electrodes, m = k, ordered as in `cells`
    under: Indices
    # (parts,) the electrode each of them lies under, from 0
    electrode: Indices
    # how many electrodes
    count: int
    # one of ELEMENTS
    element: str = "P1"

    def __post_init__(self) -> None:
        if self.element not in ELEMENTS:
            raise ValueError(f"element '{self.element}' is unknown; known: {', '.join(ELEMENTS)}.")
        bare = np.setdiff1d(np.arange(self.count), self.electrode)
        if bare.size:
            raise ValueError(f"electrode {bare[0]} (from 0) has no edge or element of the mesh; give each at least "
                             "one.")


@dataclass(frozen=True, eq=False)
class Sparsity:
    """Where the local matrices of one mesh topology go in the global one, electrodes ordered last."""

    # order of the global matrix
    size: int
    # (entries,) slot of every entry of the local matrices: cells first, then what lies under electrodes
    slot: Indices
    # (slots,) row and column of every slot, sorted by column, then row
    row: Indices
    column: Indices
    # slots that remain when the last electrode is earthed, with their row indices and column pointers
    kept: Indices
    kept_row: Indices
    kept_pointer: Indices


def quadrature_points(mesh: SkinMesh) -> Array:
    """Points (cells, q, 2), m, where the conductance is wanted."""
    return np.einsum("qk,ekx->eqx", _reference(mesh.element)[0], mesh.nodes_m[mesh.cells])


def sparsity(mesh: SkinMesh) -> Sparsity:
    """Sparsity of the system of a mesh; depends on its cells and electrodes, not on where its nodes are."""
    size = len(mesh.nodes_m) + mesh.count
    under = np.column_stack([mesh.under, len(mesh.nodes_m) + mesh.electrode])
    row = np.concatenate([np.repeat(block, block.shape[1], axis=1).ravel() for block in (mesh.cells, under)])
    column = np.concatenate([np.tile(block, block.shape[1]).ravel() for block in (mesh.cells, under)])
    unique, slot = np.unique(column.astype(np.int64) * size + row, return_inverse=True)
    row, column = unique % size, unique // size
    kept = np.flatnonzero((row < size - 1) & (column < size - 1))
    pointer = np.searchsorted(column[kept], np.arange(size))
    return Sparsity(size, slot, row, column, kept, row[kept].astype(np.int32), pointer.astype(np.int32))


def system(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance: ArrayLike, pattern: Sparsity) -> Array:
    """Values (slots,) of the CEM's matrix: sum of int grad v . sigma grad u and (1/z) int (v - V)(u - U), the latter
    over the length of lines or the area of patches.

    Conductance is (cells,) or (cells, q) where isotropic, (cells, q, 2, 2) where a tensor; z one number or (count,),
    Ohm m for lines and Ohm m^2 for patches. ValueError where z or a conductance is not positive.
    Source: Somersalo, Cheney, Isaacson, doi:10.1137/0152060.
    """
    local = contacts(mesh) / _per_electrode(mesh, contact_impedance)[mesh.electrode, None, None]
    values = [_stiffness(mesh, np.asarray(conductance_S, dtype=float)), local]
    return np.bincount(pattern.slot, np.concatenate([v.ravel() for v in values]), minlength=len(pattern.row)).astype(
        float, copy=False)


def _per_electrode(mesh: SkinMesh, contact_impedance: ArrayLike) -> Array:
    """(count,) contact impedances, checked."""
    z = np.asarray(contact_impedance, dtype=float)
    if z.shape not in ((), (mesh.count,)):
        raise ValueError(f"the contact impedance must be one number or one of each of {mesh.count} electrodes, got an "
                         f"array of shape {z.shape}.")
    if not np.all((z > 0) & np.isfinite(z)):
        wrong = np.ravel(z)[np.ravel(~((z > 0) & np.isfinite(z)))][0]
        raise ValueError(f"the contact impedance must be positive and finite, got {wrong}; leave electrodes that do "
                         "not touch out of the mesh.")
    return np.broadcast_to(z, mesh.count)


def impedance(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance: ArrayLike, *,
              pattern: Sparsity | None = None, refinements: int = 1, factorised: Factorise = factorise) -> Array:
    """Impedance matrix Z (count, count), Ohm: U = Z I for currents I that sum to zero; rows and columns sum to zero."""
    electrodes = potentials(mesh, conductance_S, contact_impedance, pattern=pattern,
                            refinements=refinements, factorised=factorised)[len(mesh.nodes_m):]
    return electrodes - electrodes.mean(axis=0)


def potentials(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance: ArrayLike, *,
               pattern: Sparsity | None = None, refinements: int = 1, factorised: Factorise = factorise) -> Array:
    """Potentials (nodes + count, count), Ohm, of nodes, then electrodes, the last one earthed; column k is for 1 A into
    electrode k and 1/count A out of every one.

    One factorisation by `factorised` (see eitsim.linear), count - 1 right-hand sides. Each refinement takes the
    residual as sum_j a_ij (x_i - x_j), which keeps all digits where the matrix has none left (rows of the CEM sum to
    zero).
    """
    pattern = sparsity(mesh) if pattern is None else pattern
    values = system(mesh, conductance_S, contact_impedance, pattern)
    order = pattern.size - 1
    solve = factorised(csc_matrix((values[pattern.kept], pattern.kept_row, pattern.kept_pointer), (order, order)))
    currents = np.zeros((order, mesh.count - 1))
    currents[len(mesh.nodes_m):] = np.eye(mesh.count - 1)
    potential = solve(currents)
    for _ in range(refinements):
        potential += solve(currents - _applied(pattern, values, potential))
    earthed = np.zeros((pattern.size, mesh.count))
    earthed[:-1, :-1] = potential
    return earthed - earthed.mean(axis=1, keepdims=True)


def gradients(mesh: SkinMesh, potential: Array) -> tuple[Array, Array]:
    """Gradients (cells, q, 2, k) of nodal potentials (n, k) at the quadrature points, and their areas (cells, q)."""
    _, gradient, weights, _ = _reference(mesh.element)
    jacobian = np.einsum("eka,qkb->eqab", mesh.nodes_m[mesh.cells], gradient)
    local = np.einsum("qkb,ekp->eqbp", gradient, potential[mesh.cells])
    return np.linalg.inv(jacobian).swapaxes(-1, -2) @ local, weights * np.abs(np.linalg.det(jacobian))


def _applied(pattern: Sparsity, values: Array, potential: Array) -> Array:
    """A x by differences along the edges of the matrix graph, the earthed electrode at 0 V."""
    x = np.vstack([potential, np.zeros(potential.shape[1])])
    off = np.flatnonzero(pattern.row != pattern.column)
    flow = values[off, None] * (x[pattern.row[off]] - x[pattern.column[off]])
    starts = np.searchsorted(pattern.column[off], np.arange(pattern.size))
    return np.add.reduceat(flow, starts, axis=0)[:-1]


@lru_cache(maxsize=2 * len(ELEMENTS))
def _reference(element: str, degree: int | None = None) -> tuple[Array, Array, Array, Array]:
    """Reference element: values (q, k), gradients (q, k, 2), weights (q,) and the products of gradients (3 q, k k), by
    default on the points of its stiffness."""
    kind = _KINDS[element][0]
    degree = _KINDS[element][1] if degree is None else degree
    points, weights = get_quadrature(kind(), degree)
    basis = [kind().lbasis(points, i) for i in range(len(kind().doflocs))]
    value = np.stack([np.broadcast_to(b[0], weights.shape) for b in basis], axis=1)
    gradient = np.stack([np.broadcast_to(b[1], points.shape).T for b in basis], axis=1)
    gx, gy = gradient[..., 0], gradient[..., 1]
    xx, yy, xy = (np.einsum("qi,qj->qij", a, b) for a, b in ((gx, gx), (gy, gy), (gx, gy)))
    products = np.stack([xx, yy, xy + xy.transpose(0, 2, 1)], axis=1)
    return value, gradient, weights, products.reshape(3 * len(weights), -1)


def _stiffness(mesh: SkinMesh, conductance: Array) -> Array:
    """Local matrices (cells, k k) of int grad v . sigma grad u; the conductance is pulled back to the element."""
    _, gradient, weights, products = _reference(mesh.element)
    x = mesh.nodes_m[mesh.cells]
    xr, xs, yr, ys = (x[..., i] @ gradient[..., j].T for i in (0, 1) for j in (0, 1))
    det = xr * ys - xs * yr
    if not np.all(det * np.sign(det[:, :1]) > 0):
        raise ValueError("the mesh has an element that is flat or folded over; check the order of its nodes.")
    sxx, syy, sxy = _components(conductance, det.shape)
    w = weights / np.abs(det)
    pulled = np.stack([w * (sxx * ys**2 - 2 * sxy * ys * xs + syy * xs**2),
                       w * (sxx * yr**2 - 2 * sxy * yr * xr + syy * xr**2),
                       w * (sxy * (ys * xr + xs * yr) - sxx * ys * yr - syy * xs * xr)], axis=-1)
    return pulled.reshape(len(x), -1) @ products


def _components(conductance: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """xx, yy and xy parts (cells, q), checked to be positive definite."""
    if conductance.ndim == 4:
        xx, yy, xy = conductance[..., 0, 0], conductance[..., 1, 1], conductance[..., 0, 1]
    else:
        xx = conductance[:, None] if conductance.ndim == 1 else conductance
        yy, xy = xx, np.zeros_like(xx)
    if not (np.all(xx > 0) and np.all(xx * yy > xy**2)):
        raise ValueError("the sheet conductance must be positive (definite) everywhere.")
    return np.broadcast_to(xx, shape), np.broadcast_to(yy, shape), np.broadcast_to(xy, shape)


def contacts(mesh: SkinMesh) -> Array:
    """Local matrices (parts, m + 1, m + 1) of int (v - V)(u - U) over what lies under electrodes, m nodes a part, the
    electrode's own potential last; m under lines, m^2 under patches."""
    value, measure = _on_cells(mesh) if mesh.under.shape[1] == mesh.cells.shape[1] else _on_edges(mesh)
    value = np.column_stack([value, -np.ones(len(value))])
    return np.einsum("eq,qi,qj->eij", measure, value, value)


def _on_edges(mesh: SkinMesh) -> tuple[Array, Array]:
    """Nodal functions (q, m) at quadrature points of edges, and the lengths (parts, q) that these stand for."""
    kind = _KINDS[mesh.element][2]()
    points, weights = get_quadrature(kind, 4)
    basis = [kind.lbasis(points, i) for i in range(mesh.under.shape[1])]
    value = np.stack([np.broadcast_to(b[0], weights.shape) for b in basis], axis=1)
    slope = np.stack([np.broadcast_to(b[1][0], weights.shape) for b in basis])
    return value, weights * np.linalg.norm(np.einsum("kq,ekx->eqx", slope, mesh.nodes_m[mesh.under]), axis=-1)


def _on_cells(mesh: SkinMesh) -> tuple[Array, Array]:
    """As `_on_edges`, of whole elements: functions (q, k), areas (parts, q)."""
    value, gradient, weights, _ = _reference(mesh.element, _AREA_DEGREE)
    jacobian = np.einsum("eka,qkb->eqab", mesh.nodes_m[mesh.under], gradient)
    return value, weights * np.abs(np.linalg.det(jacobian))
