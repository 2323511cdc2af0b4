"""Large-strain foam in three dimensions: stress and consistent tangent of the hyperfoam law in principal stretches.

F = sum l_k u_k v_k'. The second derivative of the energy splits as in the plane
(`eitsim.mechanics.solid.axisymmetric_assembly`): the block of the three stretches, and a flip and a twist mode for each
pair of them. Points come as (rings, 9, angles): the parts of F - 1 row after row, the angles last, so that loops over
them run along memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.laws import hyperfoam
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.jit import compiled

Array = NDArray[np.float64]

_PAIRS = ((0, 1), (0, 2), (1, 2))
# Sweeps of Jacobi's method, which converges quadratically; and the off-diagonal part that is rounding.
_SWEEPS, _ROUNDING = 12, 1e-32
# Number of distinct entries of a symmetric 9 x 9 matrix, and where each stands in it, row after row of the upper half.
ENTRIES = 45
UPPER = np.triu_indices(9)


@dataclass(frozen=True)
class Stretches:
    """Principal stretches of a field of deformation gradients and the axes that they act on."""

    # (rings, angles, 3) logarithmic stretches
    log: Array
    # (rings, angles, 3, 3) axes u_k and v_k in the rows
    left: Array
    right: Array


@dataclass(frozen=True)
class Response:
    """First and second derivatives of the energy by stretches and modes."""

    # (rings, angles, 3) derivative by the stretches
    force: Array
    # (rings, angles, 3, 3) second derivative by the stretches
    block: Array
    # (rings, angles, 6) second derivative along the flips and the twists of the pairs
    rest: Array


def upright(strain: Array) -> bool:
    """Whether F = 1 + strain (rings, 9, angles) keeps its orientation everywhere."""
    a, b, c, d, e, f, g, h, i = np.moveaxis(strain, 1, 0)
    volume = (1 + a) * ((1 + e) * (1 + i) - f * h) - b * (d * (1 + i) - f * g) + c * (d * h - (1 + e) * g)
    return bool(np.all(volume > 0))


def principal(strain: Array) -> Stretches:
    """Stretches and axes of F = 1 + strain (rings, 9, angles) of positive determinant."""
    rings, _, angles = strain.shape
    log, left, right = np.empty((rings, angles, 3)), np.empty((rings, angles, 3, 3)), np.empty((rings, angles, 3, 3))
    decompose(strain, log, left, right)
    return Stretches(log, left, right)


@compiled
def decompose(strain, log, left, right):
    """Fill log, left and right of `Stretches`: eigenvectors v_k of F'F - 1 by Jacobi's rotations, u_k = F v_k/l_k."""
    a, v, f = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for ring in range(strain.shape[0]):
        for j in range(strain.shape[2]):
            for r in range(3):
                for c in range(3):
                    f[r, c] = strain[ring, 3 * r + c, j]
                    v[r, c] = 1.0 if r == c else 0.0
            for r in range(3):
                for c in range(3):
                    a[r, c] = f[r, c] + f[c, r] + f[0, r] * f[0, c] + f[1, r] * f[1, c] + f[2, r] * f[2, c]
            for _ in range(_SWEEPS):
                off = a[0, 1] ** 2 + a[0, 2] ** 2 + a[1, 2] ** 2
                if off <= _ROUNDING * (a[0, 0] ** 2 + a[1, 1] ** 2 + a[2, 2] ** 2):
                    break
                for p in range(2):
                    for q in range(p + 1, 3):
                        if a[p, q] == 0.0:
                            continue
                        ratio = (a[q, q] - a[p, p]) / (2 * a[p, q])
                        t = 1 / (abs(ratio) + np.sqrt(1 + ratio * ratio))
                        if ratio < 0:
                            t = -t
                        cosine = 1 / np.sqrt(1 + t * t)
                        sine = t * cosine
                        for r in range(3):
                            x, y = a[r, p], a[r, q]
                            a[r, p], a[r, q] = cosine * x - sine * y, sine * x + cosine * y
                        for r in range(3):
                            x, y = a[p, r], a[q, r]
                            a[p, r], a[q, r] = cosine * x - sine * y, sine * x + cosine * y
                            x, y = v[r, p], v[r, q]
                            v[r, p], v[r, q] = cosine * x - sine * y, sine * x + cosine * y
            for k in range(3):
                log[ring, j, k] = np.log1p(a[k, k]) / 2
                inverse = np.exp(-log[ring, j, k])
                for r in range(3):
                    right[ring, j, k, r] = v[r, k]
                    left[ring, j, k, r] = inverse * (v[r, k] + f[r, 0] * v[0, k] + f[r, 1] * v[1, k]
                                                     + f[r, 2] * v[2, k])


def principal_plainly(strain: Array) -> Stretches:
    """What `principal` does, in numpy; order and signs of the axes may differ."""
    gradient = np.eye(3) + np.moveaxis(strain, 1, 2).reshape(len(strain), -1, 3, 3)
    left, stretch, right = np.linalg.svd(gradient)
    return Stretches(np.log(stretch), np.swapaxes(left, -1, -2), right)


def response(law: Hyperfoam, log: Array, share: float = 1.0) -> Response:
    """Derivatives of the energy at logarithmic stretches (rings, angles, 3), negative curvatures scaled by share."""
    tau, inverse = hyperfoam.kirchhoff(law, log), np.exp(-log)
    block = hyperfoam.kirchhoff_tangent(law, log) - tau[..., None] * np.eye(3)
    block = block * inverse[..., None] * inverse[..., None, :]
    rest = np.empty((*tau.shape[:-1], 6))
    for k, (i, j) in enumerate(_PAIRS):
        mean, half = (log[..., i] + log[..., j]) / 2, (log[..., i] - log[..., j]) / 2
        slope, middle = hyperfoam.kirchhoff_difference(law, mean, half), (tau[..., i] + tau[..., j]) / 2
        shrink = np.exp(-2 * mean)
        rest[..., k] = shrink * (slope * np.cosh(half) / hyperfoam.sinh_ratio(half) - middle)
        rest[..., k + 3] = shrink * (middle - slope * half * np.tanh(half))
    if share != 1:
        value, vector = np.linalg.eigh(block)
        block = (vector * (np.where(value < 0, share, 1.0) * value)[..., None, :]) @ vector.swapaxes(-1, -2)
        rest = np.where(rest < 0, share, 1.0) * rest
    return Response(tau * inverse, block, rest)


def stress_and_tangent(at: Stretches, response: Response, weight: Array) -> tuple[Array, Array]:
    """First Piola stress (rings, 9, angles) and the upper half (rings, 45, angles) of its derivative by F, times
    weight (rings, angles)."""
    rings, angles = weight.shape
    stress, tangent = np.empty((rings, 9, angles)), np.empty((rings, ENTRIES, angles))
    compose(at.left, at.right, response.force, response.block, response.rest, weight, stress, tangent)
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


def stress_and_tangent_plainly(at: Stretches, response: Response, weight: Array) -> tuple[Array, Array]:
    """What `stress_and_tangent` does, in numpy."""
    outer = at.left[..., :, None, :, None] * at.right[..., None, :, None, :]
    parts = [outer[..., k, k, :, :] for k in range(3)]
    parts += [(outer[..., i, j, :, :] + outer[..., j, i, :, :]) / np.sqrt(2) for i, j in _PAIRS]
    parts += [(outer[..., i, j, :, :] - outer[..., j, i, :, :]) / np.sqrt(2) for i, j in _PAIRS]
    modes = np.stack(parts, axis=-3).reshape(*at.log.shape[:-1], 9, 9)
    stretch, other = modes[..., :3, :], modes[..., 3:, :]
    stress = (response.force[..., None, :] @ stretch)[..., 0, :]
    tangent = stretch.swapaxes(-1, -2) @ response.block @ stretch
    tangent = tangent + (other.swapaxes(-1, -2) * response.rest[..., None, :]) @ other
    upper = tangent[..., UPPER[0], UPPER[1]]
    return np.moveaxis(stress * weight[..., None], -1, 1), np.moveaxis(upper * weight[..., None], -1, 1)
