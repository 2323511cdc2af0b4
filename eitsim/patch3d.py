"""Foam under a punch near the rim: a nonlinear three-dimensional correction of the axisymmetric solution on a patch.

With F the axisymmetric deformation gradient and P its stress, the correction d solves, for all v on the patch,
int grad v : [P(F + grad d) - P(F)] + int_rim v . P n + contact(d) - contact(0) = 0, since the axisymmetric solution has
traction where the disc ends. d is 0 on the bottom and on the patch's circle; the punch sinks by as much as leaves its
force unchanged and does not tilt. The contact is frictionless on the exact shape of the punch: a pressure that starts
from the axisymmetric one and changes with the penetration by a stiffness of its own (an augmented Lagrangian), so the
mesh resolves the correction only. Foam energy - P : grad d + contact energy is minimised. Units as in eitsim.pressing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix
from skfem import Basis, ElementHex2, FacetBasis, MeshHex2

from eitsim import patch_base, solid3d
from eitsim import punch as contact
from eitsim.linear import Solve, bordered, factorise_definite
from eitsim.newton import Minimum, System, minimise
from eitsim.patch_base import Base
from eitsim.patch_mesh import Fineness, Outline, patch_mesh
from eitsim.punch import Tool, distance
from matcal import hyperfoam
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Contact stiffness of the correction over that of the axisymmetric solution.
_SOFTNESS = 0.2
# Orders of quadrature in the foam, under the punch and on the rim.
_FOAM, _CONTACT, _RIM = 5, 9, 9
# Reference radius, thicknesses beyond the punch's edge, out to which the surface may touch it.
_REACH = 1.0
# Norm of the gradient over the force at which the correction is accepted.
_TOLERANCE = 1e-9
# Points on the boundary of the patch are told by this distance, thicknesses.
_NEAR = 1e-6


@dataclass(frozen=True)
class Foam:
    """The patch's elements; u is the correction."""

    # (elements, points, 27, 3) gradients of the shape functions
    shape: Array
    # (elements, points) quadrature weight
    weight: Array
    # (elements, 27) nodes
    nodes: Indices
    # (elements, 81) unknowns; -1 where u is zero
    numbers: Indices
    # (elements, 81, 81) places in the matrix's data; -1: none
    places: Indices
    # (elements, points, 3, 3) and (elements, points, 9): F and P of the axisymmetric state
    gradient: Array
    stress: Array


@dataclass(frozen=True)
class Facing:
    """The surface that the punch may touch."""

    # (facets, points, 27) shape functions
    shape: Array
    # (facets, points) quadrature weight
    weight: Array
    # (facets, 27), (facets, 81), (facets, 81, 81): as in Foam
    nodes: Indices
    numbers: Indices
    places: Indices
    # (facets, points, 3) axisymmetric positions
    position: Array
    # (facets, points) and (facets, points, 3): axisymmetric pressure and its direction
    pressure: Array
    normal: Array
    # (facets, points) axisymmetric penetration, 0 where there is none
    gap: Array


@dataclass(frozen=True)
class Patch:
    """A discretised correction."""

    law: Hyperfoam
    tool: Tool
    # depth of the punch in the axisymmetric state
    depth: float
    mesh: MeshHex2
    # (nodes, 3) numbers of the unknowns; -1 where u is zero
    unknown: Indices
    # structure of the matrix
    pattern: csc_matrix
    foam: Foam
    facing: Facing
    # (unknowns,) axisymmetric traction on the rim
    traction: Array
    # axisymmetric reaction of half the punch, as the facing's points sum it
    reaction: float


def make_patch(base: Base, outline: Outline, fine: Fineness) -> Patch:
    """Discretise the correction of an axisymmetric state.

    NotConverged where the state is turned inside out between its Gauss points.
    """
    mesh = patch_mesh(outline, fine)
    basis = Basis(mesh, ElementHex2(), intorder=_FOAM)
    unknown = _unknowns(basis.doflocs.T, outline.reach)
    numbers = _on(unknown, basis)
    pattern, places = _sparsity(numbers, int(unknown.max()) + 1)
    foam = _foam(base, basis, numbers, places)
    top, rim = facets_of(mesh, outline)
    facing = _facing(base, FacetBasis(mesh, ElementHex2(), facets=top, intorder=_CONTACT), unknown, pattern)
    reaction = float(np.sum(facing.weight * facing.pressure * facing.normal[..., 2]))
    traction = np.zeros(len(pattern.indptr) - 1)
    if rim.size:
        traction = _traction(base, FacetBasis(mesh, ElementHex2(), facets=rim, intorder=_RIM), unknown)
    return Patch(base.model.law, base.model.tool, float(base.state.x[-1]), mesh, unknown, pattern, foam, facing,
                 traction, reaction)


def _unknowns(nodes: Array, reach: float) -> Indices:
    fixed = np.zeros(nodes.shape, dtype=bool)
    fixed[:, 1] = np.abs(nodes[:, 1]) < _NEAR
    fixed[(nodes[:, 2] < _NEAR - 1) | (np.hypot(nodes[:, 0], nodes[:, 1]) > reach - _NEAR)] = True
    return np.where(fixed, -1, np.cumsum(~fixed.ravel()).reshape(fixed.shape) - 1)


def _on(unknown: Indices, basis: Basis | FacetBasis) -> Indices:
    nodes = nodes_of(basis)
    return unknown[nodes].reshape(len(nodes), -1)


def _foam(base: Base, basis: Basis, numbers: Indices, places: Indices) -> Foam:
    gradient = patch_base.gradient(base, points_of(basis))
    if not np.all(np.linalg.det(gradient) > 0):
        raise NotConverged("the axisymmetric state, from which the rim's correction starts, is turned inside out "
                           "between its Gauss points.", estimate=base.state.x)
    at, law = solid3d.principal(gradient), base.model.law
    shape = np.stack([np.moveaxis(np.asarray(f.grad), 0, -1) for (f,) in basis.basis], axis=-2)
    return Foam(shape, basis.dx, nodes_of(basis), numbers, places, gradient, solid3d.stress(law, at))


def _facing(base: Base, basis: FacetBasis, unknown: Indices, pattern: csc_matrix) -> Facing:
    position, tool = patch_base.surface(base, points_of(basis)), base.model.tool
    gap, normal, _ = penetration(tool, position, float(base.state.x[-1]))
    gap, numbers = np.maximum(gap, 0.0), _on(unknown, basis)
    return Facing(values_of(basis), basis.dx, nodes_of(basis), numbers, _places(numbers, pattern), position,
                  contact.pressure(tool, gap), normal, gap)


def _traction(base: Base, basis: FacetBasis, unknown: Indices) -> Array:
    at = solid3d.principal(patch_base.gradient(base, points_of(basis)))
    stress = solid3d.stress(base.model.law, at)
    force = np.einsum("fqij,jfq->fqi", stress.reshape(*stress.shape[:-1], 3, 3), np.asarray(basis.normals))
    out = np.zeros(int(unknown.max()) + 1)
    _gather(out, _on(unknown, basis), np.einsum("fq,fqi,fqa->fai", basis.dx, force, values_of(basis)))
    return out


def points_of(basis: Basis | FacetBasis) -> Array:
    """Quadrature points (cells, points, 3)."""
    return np.moveaxis(np.asarray(basis.global_coordinates()), 0, -1)


def nodes_of(basis: Basis | FacetBasis) -> Indices:
    """Nodes (cells, 27)."""
    return np.asarray(basis.element_dofs).T


def values_of(basis: FacetBasis) -> Array:
    """Shape functions (facets, points, 27)."""
    return np.stack([np.broadcast_to(np.asarray(f), basis.dx.shape) for (f,) in basis.basis], axis=-1)


def facets_of(mesh: MeshHex2, outline: Outline) -> tuple[Indices, Indices]:
    """Facets that the punch may touch, and those of the rim."""
    boundary = mesh.boundary_facets()
    x, y, z = mesh.doflocs[:, np.asarray(mesh.facets)[:, boundary]]
    near = np.hypot(x, y).min(axis=0) < outline.punch + _REACH
    rim = np.abs(np.hypot(x + outline.offset, y) - outline.disc).max(axis=0) < _NEAR
    return boundary[(np.abs(z).max(axis=0) < _NEAR) & near], boundary[rim]


def _sparsity(numbers: Indices, count: int) -> tuple[csc_matrix, Indices]:
    row, column = np.broadcast_arrays(numbers[:, :, None], numbers[:, None, :])
    kept = (row >= 0) & (column >= 0)
    entries = coo_matrix((np.ones(int(kept.sum())), (row[kept], column[kept])), shape=(count, count))
    pattern = csc_matrix(entries)
    pattern.sort_indices()
    return pattern, _places(numbers, pattern)


def _places(numbers: Indices, pattern: csc_matrix) -> Indices:
    count = len(pattern.indptr) - 1
    stored = np.repeat(np.arange(count), np.diff(pattern.indptr)) * count + pattern.indices
    row, column = np.broadcast_arrays(numbers[:, :, None], numbers[:, None, :])
    return np.where((row >= 0) & (column >= 0), np.searchsorted(stored, column * count + row), -1)


def _gather(out: Array, numbers: Indices, values: Array) -> None:
    free = numbers >= 0
    np.add.at(out, numbers[free], values.reshape(numbers.shape)[free])


def penetration(tool: Tool, position: Array, depth: float) -> tuple[Array, Array, Array]:
    """Distance (...) inside the punch, negative outside, its gradient (..., 3) and Hessian (..., 3, 3)."""
    radius, cosine, sine = patch_base.polar(position)
    gap, across, up, curvature, _ = distance(tool, radius, position[..., 2] + depth)
    along = np.stack([up * cosine, up * sine, -across], axis=-1)
    around = np.stack([-sine, cosine, np.zeros_like(sine)], axis=-1)
    bend = -curvature, across / np.where(radius > 0, radius, 1.0)
    first, second = (b[..., None, None] * t[..., :, None] * t[..., None, :]
                     for b, t in zip(bend, (along, around), strict=True))
    return gap, np.stack([across * cosine, across * sine, up], axis=-1), first + second


def nodal(patch: Patch, u: Array) -> Array:
    """Correction (nodes, 3) of the unknowns u."""
    return np.where(patch.unknown < 0, 0.0, u[patch.unknown])


def _extra(patch: Patch, u: Array) -> Array:
    """Gradient of the correction at the foam's points (elements, points, 3, 3)."""
    elements, points, nodes, _ = patch.foam.shape.shape
    flat = np.swapaxes(patch.foam.shape, 2, 3).reshape(elements, 3 * points, nodes)
    return np.swapaxes((flat @ nodal(patch, u)[patch.foam.nodes]).reshape(elements, points, 3, 3), 2, 3)


def pressed(patch: Patch, x: Array) -> tuple[Array, Array, Array, Array]:
    """Pressure (facets, points), its direction and the direction's derivative at x, and the facing's correction."""
    facing = patch.facing
    shift = facing.shape @ nodal(patch, x[:-1])[facing.nodes]
    gap, normal, bend = penetration(patch.tool, facing.position + shift, patch.depth + x[-1])
    change = _SOFTNESS * patch.tool.stiffness * (gap - facing.gap)
    return np.maximum(facing.pressure + change, 0.0), normal, bend, shift


def energy(patch: Patch, x: Array) -> float:
    """Energy at the correction x (displacements and depth); infinite where the foam is turned inside out."""
    foam, facing = patch.foam, patch.facing
    extra = _extra(patch, x[:-1])
    total = foam.gradient + extra
    if np.any(np.linalg.det(total) <= 0):
        return np.inf
    with np.errstate(over="ignore", invalid="ignore"):
        stored = hyperfoam.energy(patch.law, np.log(np.linalg.svd(total, compute_uv=False)))
        inside = float(np.sum(foam.weight * (stored - np.sum(foam.stress * extra.reshape(foam.stress.shape), axis=-1))))
    pressure, _, _, shift = pressed(patch, x)
    springs = pressure**2 / (2 * _SOFTNESS * patch.tool.stiffness)
    before = facing.pressure * np.sum(facing.normal * shift, axis=-1)
    touch = float(np.sum(facing.weight * (springs - before))) - patch.reaction * float(x[-1])
    value = inside + touch + float(patch.traction @ x[:-1])
    return value if np.isfinite(value) else np.inf


def system(patch: Patch, x: Array, share: float = 1.0) -> System:
    """Gradient of the energy at x and a function that factorises its Hessian, negative parts scaled by share."""
    foam = patch.foam
    at = solid3d.principal(foam.gradient + _extra(patch, x[:-1]))
    force = (solid3d.stress(patch.law, at) - foam.stress) * foam.weight[..., None]
    stiff = solid3d.tangent(patch.law, at, share) * foam.weight[..., None, None]
    gradient, data = patch.traction.copy(), np.zeros(patch.pattern.nnz)
    solid3d.assemble(foam.shape, force, stiff, foam.numbers, foam.places, gradient, data)
    border, corner, excess = _add_contact(patch, x, share, gradient, data)
    matrix = csc_matrix((data, patch.pattern.indices, patch.pattern.indptr), shape=patch.pattern.shape)

    def factorise() -> Solve:
        return bordered(factorise_definite(matrix), border, corner)

    return np.append(gradient, excess), factorise


def _add_contact(patch: Patch, x: Array, share: float, gradient: Array, data: Array) -> tuple[Array, float, float]:
    """Add the contact's part; border and corner of the Hessian by the depth, and the reaction's excess."""
    facing = patch.facing
    pressure, normal, bend, _ = pressed(patch, x)
    force = facing.weight[..., None] * pressure[..., None] * normal
    before = facing.weight[..., None] * facing.pressure[..., None] * facing.normal
    turned = np.swapaxes(facing.shape, 1, 2)
    _gather(gradient, facing.numbers, turned @ (force - before))
    if share != 1:
        value, vector = np.linalg.eigh(bend)
        bend = (vector * (np.where(value < 0, share, 1.0) * value)[..., None, :]) @ np.swapaxes(vector, -1, -2)
    springs = _SOFTNESS * patch.tool.stiffness * facing.weight * (pressure > 0)
    block = springs[..., None, None] * normal[..., :, None] * normal[..., None, :]
    block = block + (facing.weight * pressure)[..., None, None] * bend
    local = np.einsum("fqa,fqij,fqb->faibj", facing.shape, block, facing.shape, optimize=True)
    _gather(data, facing.places, local)
    border = np.zeros(gradient.size)
    _gather(border, facing.numbers, turned @ block[..., 2])
    return border, float(np.sum(block[..., 2, 2])), float(np.sum(force[..., 2]) - patch.reaction)


def correction(patch: Patch) -> Minimum:
    """Correction x (unknowns + 1,) of displacements and depth; NotConverged as `minimise`."""
    start = np.zeros(patch.traction.size + 1)
    return minimise(lambda x: energy(patch, x), lambda x, share: system(patch, x, share), start, scale=patch.reaction,
                    tolerance=_TOLERANCE)
