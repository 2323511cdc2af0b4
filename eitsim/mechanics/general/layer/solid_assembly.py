"""Energy, gradient and elements' stiffness matrices of a layer of wedges, by the law at the quadrature's points."""

import numpy as np

from eitsim.mechanics.general.meshing.wedge_mesh import WedgeMesh
from eitsim.mechanics.solid import spatial_response
from eitsim.mechanics.solid.spatial_response import UPPER
from matcal.laws.compiled_response import energies
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import compiled

# Where each part of a symmetric 9 x 9 matrix stands among its distinct entries.
_PLACE = np.zeros((9, 9), dtype=np.int64)
_PLACE[UPPER] = _PLACE.T[UPPER] = np.arange(len(UPPER[0]))


def nodal(mesh: WedgeMesh, u: Array) -> Array:
    """Displacements (nodes, 3) of the unknowns u, zero where they are fixed."""
    return np.where(mesh.unknown < 0, 0.0, u[mesh.unknown])


def displacement_gradient(mesh: WedgeMesh, moved: Array) -> Array:
    """Displacement gradients (e, 9, q) of displacements (nodes, 3)."""
    count, nodes, _, points = mesh.gradient.shape
    slope = np.swapaxes(moved[mesh.elements], 1, 2) @ mesh.gradient.reshape(count, nodes, 3 * points)
    return slope.reshape(count, 9, points)


def energy(law: Law, mesh: WedgeMesh, moved: Array) -> float:
    """Stored energy; infinite where the layer would be turned inside out or leaves the range of numbers."""
    grad_u = displacement_gradient(mesh, moved)
    if not spatial_response.upright(grad_u):
        return np.inf
    with np.errstate(over="ignore", invalid="ignore"):
        local = energies(law, spatial_response.principal(grad_u).log.reshape(-1, 3))
        stored = float(mesh.weight.ravel() @ local)
    return stored if np.isfinite(stored) else np.inf


def forces_and_matrices(law: Law, mesh: WedgeMesh, moved: Array, negative_curvature_scale: float = 1.0
                        ) -> tuple[Array, Array]:
    """Derivative of the energy by the nodes' displacements (nodes, 3), and second derivatives (e, 54, 54) by those of
    each element's nodes, the negative ones at points scaled."""
    at = spatial_response.principal(displacement_gradient(mesh, moved))
    stress, tangent = spatial_response.stress_and_tangent(law, at, mesh.weight, negative_curvature_scale)
    count, nodes, _, points = mesh.gradient.shape
    flat = mesh.gradient.reshape(count, nodes, 3 * points)
    push = flat @ np.swapaxes(stress.reshape(count, 3, 3 * points), 1, 2)
    out, matrices = np.zeros((len(mesh.nodes), 3)), np.empty((count, 3 * nodes, 3 * nodes))
    np.add.at(out, mesh.elements, push)
    _stiffness(flat, tangent, _PLACE, matrices)
    return out, matrices


@compiled
def _stiffness(gradient, tangent, place, matrices):
    """Matrices sum_q B' C B of gradients (e, nodes, 3 q) and distinct entries of C (e, 45, q)."""
    count, nodes, width = gradient.shape
    points = width // 3
    stressed = np.empty((3, 3 * nodes, width))
    for e in range(count):
        slope, c = gradient[e], tangent[e]
        for a in range(nodes):
            for i in range(3):
                for k in range(3):
                    for m in range(3):
                        one, two, three = c[place[3 * i, 3 * k + m]], c[place[3 * i + 1, 3 * k + m]], c[
                            place[3 * i + 2, 3 * k + m]]
                        for q in range(points):
                            stressed[k, 3 * a + i, m * points + q] = (
                                slope[a, q] * one[q] + slope[a, points + q] * two[q]
                                + slope[a, 2 * points + q] * three[q])
        for k in range(3):
            part = np.dot(stressed[k], slope.T)
            for row in range(3 * nodes):
                for b in range(nodes):
                    matrices[e, row, 3 * b + k] = part[row, b]
