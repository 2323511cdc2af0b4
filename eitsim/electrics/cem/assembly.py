"""Complete electrode model on a given mesh: from sheet conductance to the impedance matrix of the electrodes.

Direct currents alone: conductances, contact impedances and potentials are real.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import ElementLineP1, ElementLineP2, ElementQuad2, ElementTriP1, ElementTriP2
from skfem.quadrature import get_quadrature

from eitsim.numerics.conductor_elimination import Detached, Elimination, eliminate, impedance_alone, residual, solve
from eitsim.numerics.nested_dissection import Dissection, dissect
from touchcal.arrays import Array

Indices = NDArray[np.integer]

ELEMENTS = ("P1", "P2", "Q2")
# element, degree of exactness of its quadrature, element of its edges
_KINDS = {"P1": (ElementTriP1, 1, ElementLineP1), "P2": (ElementTriP2, 4, ElementLineP2),
          "Q2": (ElementQuad2, 5, ElementLineP2)}
_AREA_DEGREE = 6  # Degree of exactness of the quadrature over areas under patches.
_ROUNDING = 1e-4  # Rounding of the resistance between two electrodes, relative, at most.
_UNSYMMETRIC = 1e-12  # Largest difference of a tensor's xy and yx over the sum of its xx and yy.


@dataclass(frozen=True, eq=False)
class SkinMesh:
    """The skin's reference surface cut into elements, and what of it lies under electrodes: edges under lines, whole
    elements under patches."""

    # (n, d) nodes, m, d = 2, or 3 of a sheet in space; elements are isoparametric, so middle nodes may lie on curves
    nodes_m: Array
    cells: Indices  # (cells, k) node numbers of each element, in scikit-fem's local order of degrees of freedom
    # (parts, m) node numbers of the edges under electrodes, m = 2 or 3: both ends, then the middle where the element
    # has one; or of the elements under electrodes, m = k, ordered as in `cells`
    under: Indices
    electrode: Indices  # (parts,) the electrode each of them lies under, from 0
    count: int  # how many electrodes
    element: str = "P1"  # one of ELEMENTS
    # (parts, 2) where on each edge its electrode starts and ends, from 0 at its first node to 1 at its second; None: at
    # its nodes
    covered: Array | None = None

    def __post_init__(self) -> None:
        if self.element not in ELEMENTS:
            raise ValueError(f"element '{self.element}' is unknown; known: {', '.join(ELEMENTS)}.")
        bare = np.setdiff1d(np.arange(self.count), self.electrode)
        if bare.size:
            raise ValueError(f"electrode {bare[0]} (from 0) has no edge or element of the mesh; give each at least "
                             "one.")


@dataclass(frozen=True, eq=False)
class Floating:
    """Conductors on the surface that let no current out (`eitsim.electrics.cem.floating_electrodes`), each an
    unknown after the nodes."""

    under: Indices  # (parts, k) node numbers of the elements that each part covers, ordered as in the mesh's cells
    conductor: Indices  # (parts,) the conductor that lies on each, from 0
    weights: Array  # (parts, pairs) weights, 1/Ohm, of the pairs of its nodes and, last, its conductor
    count: int  # how many conductors


def quadrature_points(mesh: SkinMesh, parts: int = 1, degree: int | None = None) -> Array:
    """Points (cells, q, 2 or 3), m, where the conductance is needed, in each of the parts of each side of a cell; of
    another degree of exactness where it is given."""
    return _reference(mesh.element, degree, parts)[0] @ mesh.nodes_m[mesh.cells]


def area_points(mesh: SkinMesh) -> Array:
    """Points (cells, q, 2), m, at which what lies on areas is summed."""
    return _reference(mesh.element, _AREA_DEGREE)[0] @ mesh.nodes_m[mesh.cells]


def joined_over_areas(mesh: SkinMesh, cell: Indices, conductance: Array) -> Array:
    """Weights (parts, pairs), 1/Ohm, of int g (v - V)(u - U) over cells (parts,) that something lies on, of g (parts,
    q), S/m^2, at their `area_points`: pairs of the cells' nodes and, last, of what lies there."""
    value, area = _on_cells(mesh, mesh.cells[cell])
    local = joined(value, conductance * area)
    return -local[:, *np.triu_indices(local.shape[1], 1)]


def dissection(mesh: SkinMesh, floating: Floating | None = None) -> Dissection:
    """Order of elimination of nodes, then floating conductors, then electrodes; it fits every mesh with these cells,
    conductors and electrodes, wherever its nodes are. ValueError where a node belongs to no cell."""
    place = np.stack([along[mesh.cells].mean(axis=1) for along in mesh.nodes_m.T], axis=1)
    if place.shape[1] == 3:  # seen along the direction in which a sheet in space extends least
        place = place @ np.linalg.svd(place - place.mean(axis=0), full_matrices=False)[2][:2].T
    return dissect(place, _blocks(mesh, floating), _conductors(floating) + mesh.count)


def _blocks(mesh: SkinMesh, floating: Floating | None) -> list[Indices]:
    """Unknowns of each cell, then of each part under an electrode, then of each part under a floating conductor."""
    first = len(mesh.nodes_m)
    blocks = [mesh.cells, np.column_stack([mesh.under, first + _conductors(floating) + mesh.electrode])]
    return blocks if floating is None else [*blocks, np.column_stack([floating.under, first + floating.conductor])]


def _conductors(floating: Floating | None) -> int:
    return 0 if floating is None else floating.count


def _fitting(mesh: SkinMesh, order: Dissection | None, floating: Floating | None) -> Dissection:
    """The mesh's order, or the one given, checked to be of these cells, conductors and electrodes."""
    if order is None:
        return dissection(mesh, floating)
    size, blocks = len(mesh.nodes_m) + _conductors(floating) + mesh.count, _blocks(mesh, floating)
    if len(order.order) != size or len(order.blocks) != len(blocks) or not all(
            map(np.array_equal, order.blocks, blocks)):
        raise ValueError("the order of elimination is that of a mesh with other cells or electrodes; take the one that "
                         "`dissection` finds for this very mesh.")
    return order


def weights(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance: ArrayLike) -> Array:
    """Weights (pairs,), 1/Ohm, of the CEM's matrix sum_ij w_ij (e_i - e_j)(e_i - e_j)', over the pairs of nodes of each
    cell, then of each part under an electrode and that electrode.

    The matrix is int grad v . sigma grad u + (1/z) int (v - V)(u - U), over lengths under lines, areas under patches;
    its rows sum to zero. Conductance is (cells,) or (cells, q) where isotropic, (cells, q, 2, 2) where a tensor; z one
    number or (count,), Ohm m for lines and Ohm m^2 for patches. On a sheet in space tensors are seen along the
    `tangent_frames`. ValueError where z or a conductance is not positive, or a tensor not symmetric.
    Source: Somersalo, Cheney, Isaacson, doi:10.1137/0152060.
    """
    local = contacts(mesh) / per_electrode(mesh.count, contact_impedance)[mesh.electrode, None, None]
    i, j = np.triu_indices(local.shape[1], 1)
    return np.concatenate([_stiffness(mesh, np.asarray(conductance_S, dtype=float)).ravel(), -local[:, i, j].ravel()])


def per_electrode(count: int, contact_impedance: ArrayLike) -> Array:
    """(count,) contact impedances, checked."""
    z = np.asarray(contact_impedance, dtype=float)
    if z.shape not in ((), (count,)):
        raise ValueError(f"the contact impedance must be one number or one of each of {count} electrodes, got an "
                         f"array of shape {z.shape}.")
    if not np.all((z > 0) & np.isfinite(z)):
        wrong = np.ravel(z)[np.ravel(~((z > 0) & np.isfinite(z)))][0]
        raise ValueError(f"the contact impedance must be positive and finite, got {wrong}; leave electrodes that do "
                         "not touch out of the mesh.")
    return np.broadcast_to(z, count)


def eliminated(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance: ArrayLike, *,
               order: Dissection | None = None, floating: Floating | None = None) -> Elimination:
    """All nodes, floating conductors and electrodes but the last eliminated, in an order of `dissection`.

    ValueError where the order is that of other cells, conductors or electrodes, a part of the mesh is joined to no
    electrode, or an electrode to no other.
    """
    order = _fitting(mesh, order, floating)
    try:
        return eliminate(order, _with_floating(weights(mesh, conductance_S, contact_impedance), floating))
    except Detached as lost:
        raise _torn(mesh, lost, floating) from None


def _with_floating(weights: Array, floating: Floating | None) -> Array:
    return weights if floating is None else np.concatenate([weights, floating.weights.ravel()])


def _torn(mesh: SkinMesh, lost: Detached, floating: Floating | None) -> ValueError:
    return ValueError(f"the sheet is torn: no current flows between {_named(mesh, lost.unknown, floating)} and "
                      f"electrode {mesh.count - 1} (from 0), or none that counts against others; join the parts of the "
                      "mesh or leave what is torn off, with its electrodes, out of it.")


def _named(mesh: SkinMesh, unknown: int, floating: Floating | None) -> str:
    place = unknown - len(mesh.nodes_m)
    if place >= 0:
        electrode = place - _conductors(floating)
        return f"floating conductor {place}" if electrode < 0 else f"electrode {electrode}"
    return f"the node at ({', '.join(f'{part:.3g}' for part in mesh.nodes_m[unknown] * 1e3)}) mm"


def impedance(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance: ArrayLike, *,
              order: Dissection | None = None, refinements: int = 0, floating: Floating | None = None) -> Array:
    """Impedance matrix Z (count, count), Ohm: U = Z I for currents I that sum to zero; rows and columns sum to zero.

    See `eliminated`. Z = Y' Y from the electrodes' rows of the factor alone, and no front is kept; it is symmetric by
    its form, and its relative error is about twice that of Y. With refinements Z is the electrodes' rows of
    `potentials`, symmetric to rounding only: their substitution sums over all nodes, so that they can lose digits:
    one of Q2 elements, two where tensors differ much in their axes (benchmarks/electrics_stiff.py).
    ValueError where the resistance between two electrodes keeps fewer than four digits next to that between others.
    """
    if refinements > 0:
        return centred(mesh, potentials(mesh, conductance_S, contact_impedance, order=order, refinements=refinements,
                                        floating=floating))[-mesh.count:]
    order, given = _fitting(mesh, order, floating), weights(mesh, conductance_S, contact_impedance)
    try:
        return resolved(impedance_alone(order, _with_floating(given, floating), mesh.count))
    except Detached as lost:
        raise _torn(mesh, lost, floating) from None


def potentials(mesh: SkinMesh, conductance_S: ArrayLike, contact_impedance: ArrayLike, *,
               order: Dissection | None = None, refinements: int = 0, floating: Floating | None = None) -> Array:
    """Potentials (nodes + count, count), Ohm, of nodes, then electrodes, the last one earthed; column k is for 1 A into
    electrode k and 1/count A out of every one. Those of floating conductors come between nodes and electrodes. See
    `eliminated`; refused where `impedance` is.

    Each refinement solves for the currents that are left over, summed from differences of potentials.
    """
    done = eliminated(mesh, conductance_S, contact_impedance, order=order, floating=floating)
    currents = np.zeros((len(mesh.nodes_m) + _conductors(floating) + mesh.count, mesh.count))
    currents[-mesh.count:] = np.eye(mesh.count) - 1 / mesh.count
    potential = solve(done, currents)
    for _ in range(refinements):
        potential += solve(done, residual(done, currents, potential))
    resolved(centred(mesh, potential)[-mesh.count:])
    return potential


def centred(mesh: SkinMesh, potential: Array) -> Array:
    """Potentials (nodes + count, n) less the mean of the electrodes', the impedance matrix in the last rows of
    `potentials`."""
    return potential - potential[-mesh.count:].mean(axis=0)


def resolved(z: Array) -> Array:
    """The impedance matrix, refused where its rounding hides the resistance between two electrodes."""
    own = np.diagonal(z)
    between = (own[:, None] + own - 2 * z)[~np.eye(len(z), dtype=bool)]
    if not between.min() > np.finfo(float).eps / _ROUNDING * np.abs(z).max():
        raise ValueError(f"the sheet is all but torn, or an electrode all but without contact: resistances between "
                         f"electrodes reach {between.max():.1e} Ohm, next to which the least of them keeps fewer than "
                         "four digits; leave out what is torn off, or give cut and contacts a larger conductance.")
    return z


def gradients(mesh: SkinMesh, potential: Array, parts: int = 1, degree: int | None = None) -> tuple[Array, Array]:
    """Gradients (cells, q, 2, k) of nodal potentials (n, k) at the `quadrature_points` of a flat sheet, and their areas
    (cells, q)."""
    gradient = _reference(mesh.element, degree, parts)[1]
    points, nodes, _ = gradient.shape
    local = gradient.swapaxes(1, 2).reshape(-1, nodes) @ potential[mesh.cells]
    return _in_the_plane(mesh, parts, degree, *np.moveaxis(local.reshape(len(mesh.cells), points, 2, -1), 2, 0))


def slopes(mesh: SkinMesh, parts: int = 1, degree: int | None = None) -> tuple[Array, Array]:
    """Gradients (cells, q, 2, nodes) of the functions of each cell's nodes, and areas, as `gradients`."""
    return _in_the_plane(mesh, parts, degree, *np.moveaxis(_reference(mesh.element, degree, parts)[1], 2, 0))


def _in_the_plane(mesh: SkinMesh, parts: int, degree: int | None, along: Array, across: Array) -> tuple[Array, Array]:
    """Gradients (cells, q, 2, k) and areas (cells, q) of slopes ([cells,] q, k) by the reference element's axes."""
    _, gradient, weights, _ = _reference(mesh.element, degree, parts)
    x = mesh.nodes_m[mesh.cells]
    xr, xs, yr, ys = (x[..., i] @ gradient[..., j].T for i in (0, 1) for j in (0, 1))
    det = xr * ys - xs * yr
    found = np.empty((*det.shape, 2, along.shape[-1]))
    found[:, :, 0] = (ys / det)[..., None] * along - (yr / det)[..., None] * across
    found[:, :, 1] = (xr / det)[..., None] * across - (xs / det)[..., None] * along
    return found, weights * np.abs(det)


@lru_cache(maxsize=4 * len(ELEMENTS))
def _reference(element: str, degree: int | None = None, parts: int = 1) -> tuple[Array, Array, Array, Array]:
    """Reference element: values (q, k), gradients (q, k, 2), weights (q,) and the negative products of the gradients of
    pairs (3 q, pairs), by default on the points of its stiffness; in each of the parts of each of its sides."""
    kind = _KINDS[element][0]
    degree = _KINDS[element][1] if degree is None else degree
    points, weights = _in_parts(*get_quadrature(kind(), degree), parts, triangle=element != "Q2")
    basis = [kind().lbasis(points, i) for i in range(len(kind().doflocs))]
    value = np.stack([np.broadcast_to(b[0], weights.shape) for b in basis], axis=1)
    gradient = np.stack([np.broadcast_to(b[1], points.shape).T for b in basis], axis=1)
    gx, gy = gradient[..., 0], gradient[..., 1]
    i, j = np.triu_indices(gx.shape[1], 1)
    products = np.stack([gx[:, i] * gx[:, j], gy[:, i] * gy[:, j], gx[:, i] * gy[:, j] + gy[:, i] * gx[:, j]], axis=1)
    return value, gradient, weights, -products.reshape(3 * len(weights), -1)


def _in_parts(points: Array, weights: Array, parts: int, *, triangle: bool) -> tuple[Array, Array]:
    """Quadrature points (2, q) and weights (q,) of a reference element in each of its equal parts."""
    first, second = (index.ravel() for index in np.indices((parts, parts)))
    upright = np.stack([first, second])[:, first + second < parts] if triangle else np.stack([first, second])
    placed = [upright[:, :, None] + points[:, None, :]]
    if triangle:  # upside down between them
        turned = np.stack([first, second])[:, first + second < parts - 1] + 1
        placed.append(turned[:, :, None] - points[:, None, :])
    inside = np.concatenate(placed, axis=1).reshape(2, -1) / parts
    return inside, np.tile(weights, parts**2) / parts**2


def _stiffness(mesh: SkinMesh, conductance: Array) -> Array:
    """Weights (cells, pairs) of int grad v . sigma grad u; the conductance is pulled back to the element."""
    _, gradient, weights, products = _reference(mesh.element)
    x = mesh.nodes_m[mesh.cells]
    if x.shape[2] == 3:
        xr, xs, yr, ys = _in_tangent_planes(x, gradient)
    else:
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


def _in_tangent_planes(x: Array, gradient: Array) -> tuple[Array, Array, Array, Array]:
    """Parts (cells, q) along both axes of `tangent_frames` of the derivatives of places on a sheet in space; negative
    turns where it is folded over."""
    one, other = (np.einsum("ekx,qk->eqx", x, gradient[..., i]) for i in (0, 1))
    first, second, normal = np.moveaxis(tangent_axes(one, other), -1, 0)
    upright = np.where(np.sum(normal * normal[:, :1], axis=-1) > 0, 1.0, -1.0)
    along = np.sum(one * first, axis=-1)
    return along, np.sum(other * first, axis=-1), np.zeros_like(along), upright * np.sum(other * second, axis=-1)


def tangent_axes(one: Array, other: Array) -> Array:
    """Orthonormal frames (..., 3, 3) of two tangents (..., 3); columns: along the first, across it, and normal."""
    normal = np.cross(one, other)
    first, normal = (v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), np.finfo(float).tiny)
                     for v in (one, normal))
    return np.stack([first, np.cross(normal, first), normal], axis=-1)


def tangent_frames(mesh: SkinMesh) -> Array:
    """Orthonormal frames (cells, q, 3, 3) at the `quadrature_points` of a sheet in space: columns along the cell's
    first reference axis, across it, and normal. Tensors of its conductance are seen along the first two."""
    gradient, x = _reference(mesh.element)[1], mesh.nodes_m[mesh.cells]
    return tangent_axes(*(np.einsum("ekx,qk->eqx", x, gradient[..., i]) for i in (0, 1)))


def _components(conductance: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """xx, yy and xy parts (cells, q), checked to be symmetric and positive definite."""
    if conductance.ndim == 4:
        xx, yy, xy = conductance[..., 0, 0], conductance[..., 1, 1], conductance[..., 0, 1]
    else:
        xx = conductance[:, None] if conductance.ndim == 1 else conductance
        yy, xy = xx, np.zeros_like(xx)
    if not (np.all((xx > 0) & (xx < np.inf)) and np.all(xx * yy > xy**2)):
        raise ValueError("the sheet conductance must be positive (definite) and finite everywhere.")
    if conductance.ndim == 4 and not np.all(np.abs(xy - conductance[..., 1, 0]) <= _UNSYMMETRIC * (xx + yy)):
        raise ValueError("the sheet conductance must be symmetric everywhere, got tensors whose xy and yx differ.")
    return np.broadcast_to(xx, shape), np.broadcast_to(yy, shape), np.broadcast_to(xy, shape)


def contacts(mesh: SkinMesh) -> Array:
    """Local matrices (parts, m + 1, m + 1) of int (v - V)(u - U) over what lies under electrodes, m nodes a part, the
    electrode's own potential last; m under lines, m^2 under patches."""
    if mesh.covered is not None:
        return joined(*_on_parts_of_edges(mesh, mesh.covered))
    return joined(*(_on_cells(mesh, mesh.under) if mesh.under.shape[1] == mesh.cells.shape[1] else _on_edges(mesh)))


def joined(value: Array, measure: Array) -> Array:
    value = np.concatenate([value, np.full((*value.shape[:-1], 1), -1.0)], axis=-1)
    return np.einsum("eq,qi,qj->eij" if value.ndim == 2 else "eq,eqi,eqj->eij", measure, value, value)


def _on_edges(mesh: SkinMesh) -> tuple[Array, Array]:
    """Nodal functions (q, m) at quadrature points of edges, and the lengths (parts, q) that these stand for."""
    value, slope, weights = _reference_edge(mesh.element)
    return value, weights * np.linalg.norm(slope @ mesh.nodes_m[mesh.under], axis=-1)


def _on_parts_of_edges(mesh: SkinMesh, covered: Array) -> tuple[Array, Array]:
    """As `_on_edges`, of the parts (parts, 2) of edges that electrodes cover: functions (parts, q, m), lengths."""
    points, weights = get_quadrature(_KINDS[mesh.element][2](), 4)
    share = np.diff(covered, axis=1)
    value, slope = edge_functions(mesh.element, covered[:, :1] + share * points)
    return value, share * weights * np.linalg.norm(slope @ mesh.nodes_m[mesh.under], axis=-1)


def edge_functions(element: str, at: Array) -> tuple[Array, Array]:
    """Nodal functions (..., m) of an element's edge, and their slopes, at places (...) from 0 to 1 along it."""
    kind = _KINDS[element][2]()
    basis = [kind.lbasis(at.reshape(1, -1), i) for i in range(len(kind.doflocs))]
    value, slope = (np.stack([np.broadcast_to(part, at.size) for part in parts], axis=1)
                    for parts in ([b[0] for b in basis], [b[1][0] for b in basis]))
    return value.reshape(*at.shape, -1), slope.reshape(*at.shape, -1)


@lru_cache(maxsize=len(ELEMENTS))
def _reference_edge(element: str) -> tuple[Array, Array, Array]:
    """Values (q, m) and slopes (q, m) of an element's edge, and weights (q,)."""
    kind = _KINDS[element][2]()
    points, weights = get_quadrature(kind, 4)
    basis = [kind.lbasis(points, i) for i in range(len(kind.doflocs))]
    value, slope = (np.stack([np.broadcast_to(part, weights.shape) for part in parts], axis=1)
                    for parts in ([b[0] for b in basis], [b[1][0] for b in basis]))
    return value, slope, weights


def _on_cells(mesh: SkinMesh, cells: Indices) -> tuple[Array, Array]:
    """As `_on_edges`, of whole elements (parts, k): functions (q, k), areas (parts, q)."""
    value, gradient, weights, _ = _reference(mesh.element, _AREA_DEGREE)
    jacobian = np.einsum("eka,qkb->eqab", mesh.nodes_m[cells], gradient)
    if jacobian.shape[2] == 3:
        return value, weights * np.linalg.norm(np.cross(jacobian[..., 0], jacobian[..., 1]), axis=-1)
    return value, weights * np.abs(np.linalg.det(jacobian))
