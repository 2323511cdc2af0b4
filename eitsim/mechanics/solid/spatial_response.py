"""Large-strain foam in three dimensions: stress and consistent tangent of a law in principal stretches.

F = sum l_k u_k v_k', with the modes of `eitsim.mechanics.solid.principal_stretches` for all three pairs. Points come as
(rings, 9, angles): the parts of F - 1 row after row, the angles last, so that loops over them run along memory.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.solid.principal_stretches import diagonalise, differentiate
from matcal.laws.compiled_response import responses
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import compiled

# Where the 45 distinct entries of a symmetric 9 x 9 matrix stand in it, row after row of the upper half.
UPPER = np.triu_indices(9)


@dataclass(frozen=True)
class Stretches:
    """Principal stretches of a field of deformation gradients and the axes that they act on."""

    log: Array  # (rings, angles, 3) logarithmic stretches
    # (rings, angles, 3, 3) axes u_k and v_k in the rows
    left: Array
    right: Array


def upright(grad_u: Array) -> bool:
    """Whether F = 1 + grad_u (rings, 9, angles) keeps its orientation everywhere."""
    a, b, c, d, e, f, g, h, i = np.moveaxis(grad_u, 1, 0)
    volume = (1 + a) * ((1 + e) * (1 + i) - f * h) - b * (d * (1 + i) - f * g) + c * (d * h - (1 + e) * g)
    return bool(np.all(volume > 0))


def principal(grad_u: Array) -> Stretches:
    """Stretches and axes of F = 1 + grad_u (rings, 9, angles) of positive determinant."""
    rings, _, angles = grad_u.shape
    log, left, right = np.empty((rings, angles, 3)), np.empty((rings, angles, 3, 3)), np.empty((rings, angles, 3, 3))
    decompose(grad_u, log, left, right)
    return Stretches(log, left, right)


@compiled
def decompose(grad_u, log, left, right):
    """Fill log, left and right of `Stretches`: eigenvectors v_k of F'F - 1, u_k = F v_k/l_k."""
    a, v, f = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for ring in range(grad_u.shape[0]):
        for j in range(grad_u.shape[2]):
            for r in range(3):
                for c in range(3):
                    f[r, c] = grad_u[ring, 3 * r + c, j]
            for r in range(3):
                for c in range(3):
                    a[r, c] = f[r, c] + f[c, r] + f[0, r] * f[0, c] + f[1, r] * f[1, c] + f[2, r] * f[2, c]
            diagonalise(a, v)
            for k in range(3):
                log[ring, j, k] = np.log1p(a[k, k]) / 2
                inverse = np.exp(-log[ring, j, k])
                for r in range(3):
                    right[ring, j, k, r] = v[r, k]
                    left[ring, j, k, r] = inverse * (v[r, k] + f[r, 0] * v[0, k] + f[r, 1] * v[1, k]
                                                     + f[r, 2] * v[2, k])


@compiled
def _derivatives(x, mean, half, slope, scale, force, block, rest):
    """`differentiate` at many points."""
    work = np.empty((3, 3, 3))
    for n in range(x.shape[0]):
        differentiate(x[n], mean[n], half[n], slope[n], scale, force[n], block[n], rest[n], work)


def stress_and_tangent(law: Law, at: Stretches, weight: Array,
                       negative_curvature_scale: float = 1.0) -> tuple[Array, Array]:
    """First Piola stress (rings, 9, angles) and the upper half (rings, 45, angles) of its derivative by F, negative
    curvatures scaled, times weight (rings, angles)."""
    rings, angles = weight.shape
    x = at.log.reshape(-1, 3)
    one, other = (np.take(x, pairs, axis=1) for pairs in ([0, 0, 1], [1, 2, 2]))
    mean, half = (one + other) / 2, (one - other) / 2
    force, block, slope = responses(law, x, mean, half)
    rest = np.empty((len(x), 6))
    _derivatives(x, mean, half, slope, negative_curvature_scale, force, block, rest)
    stress, tangent = np.empty((rings, 9, angles)), np.empty((rings, len(UPPER[0]), angles))
    compose(at.left, at.right, force.reshape(at.log.shape), block.reshape(*at.log.shape, 3),
            rest.reshape(rings, angles, 6), weight, stress, tangent)
    return stress, tangent


@compiled
def compose(left, right, force, block, rest, weight, stress, tangent):
    """Fill stress and tangent of `stress_and_tangent`."""
    modes, pulled = np.empty((9, 9)), np.empty((3, 9))
    root = np.sqrt(0.5)
    for ring in range(stress.shape[0]):
        for j in range(stress.shape[2]):
            u, v, w = left[ring, j], right[ring, j], weight[ring, j]
            for r in range(3):
                for c in range(3):
                    for k in range(3):
                        modes[k, 3 * r + c] = u[k, r] * v[k, c]
                    for k in range(3):
                        one, other = (0 if k < 2 else 1), (1 if k == 0 else 2)
                        first, second = u[one, r] * v[other, c], u[other, r] * v[one, c]
                        modes[3 + k, 3 * r + c] = root * (first + second)
                        modes[6 + k, 3 * r + c] = root * (first - second)
            for p in range(9):
                stress[ring, p, j] = w * (force[ring, j, 0] * modes[0, p] + force[ring, j, 1] * modes[1, p]
                                          + force[ring, j, 2] * modes[2, p])
                for k in range(3):
                    pulled[k, p] = (block[ring, j, k, 0] * modes[0, p] + block[ring, j, k, 1] * modes[1, p]
                                    + block[ring, j, k, 2] * modes[2, p])
            entry = 0
            for p in range(9):
                for q in range(p, 9):
                    total = modes[0, p] * pulled[0, q] + modes[1, p] * pulled[1, q] + modes[2, p] * pulled[2, q]
                    for k in range(6):
                        total += rest[ring, j, k] * modes[3 + k, p] * modes[3 + k, q]
                    tangent[ring, entry, j] = w * total
                    entry += 1
