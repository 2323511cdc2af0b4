"""Large-strain foam in three dimensions: stress and consistent tangent in principal stretches, and their assembly.

F = sum l_k u_k v_k'. The second derivative of the energy splits as in the plane (`eitsim.solid`): the block of the
three stretches, and a flip and a twist mode for each pair of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.solid import compiled
from matcal import hyperfoam
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]

_PAIRS = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Stretches:
    """Principal stretches of deformation gradients and the modes that they act on."""

    # (..., 3) logarithmic stretches
    log: Array
    # (..., 9, 9) modes (stretch 1 to 3, flips, twists) x parts of F, row after row
    modes: Array


def principal(gradient: Array) -> Stretches:
    """Stretches and modes of deformation gradients (..., 3, 3) of positive determinant."""
    u, stretch, v = np.linalg.svd(gradient)
    outer = u.swapaxes(-1, -2)[..., :, None, :, None] * v[..., None, :, None, :]
    parts = [outer[..., k, k, :, :] for k in range(3)]
    parts += [(outer[..., i, j, :, :] + outer[..., j, i, :, :]) / np.sqrt(2) for i, j in _PAIRS]
    parts += [(outer[..., i, j, :, :] - outer[..., j, i, :, :]) / np.sqrt(2) for i, j in _PAIRS]
    modes = np.stack(parts, axis=-3)
    return Stretches(np.log(stretch), modes.reshape(*modes.shape[:-2], 9))


def stress(law: Hyperfoam, at: Stretches) -> Array:
    """First Piola stress (..., 9)."""
    force = hyperfoam.kirchhoff(law, at.log) * np.exp(-at.log)
    return (force[..., None, :] @ at.modes[..., :3, :])[..., 0, :]


def tangent(law: Hyperfoam, at: Stretches, share: float = 1.0) -> Array:
    """Derivative (..., 9, 9) of the stress by F, its negative modes scaled by share."""
    tau, inverse = hyperfoam.kirchhoff(law, at.log), np.exp(-at.log)
    block = hyperfoam.kirchhoff_tangent(law, at.log) - tau[..., None] * np.eye(3)
    block = block * inverse[..., None] * inverse[..., None, :]
    rest = np.empty((*tau.shape[:-1], 6))
    for k, (i, j) in enumerate(_PAIRS):
        mean, half = (at.log[..., i] + at.log[..., j]) / 2, (at.log[..., i] - at.log[..., j]) / 2
        slope, middle = hyperfoam.kirchhoff_difference(law, mean, half), (tau[..., i] + tau[..., j]) / 2
        rest[..., k] = slope * np.cosh(half) / hyperfoam.sinh_ratio(half) - middle
        rest[..., k + 3] = middle - slope * half * np.tanh(half)
        rest[..., [k, k + 3]] *= np.exp(-2 * mean)[..., None]
    if share != 1:
        value, vector = np.linalg.eigh(block)
        block = (vector * (np.where(value < 0, share, 1.0) * value)[..., None, :]) @ vector.swapaxes(-1, -2)
        rest = np.where(rest < 0, share, 1.0) * rest
    stretch, other = at.modes[..., :3, :], at.modes[..., 3:, :]
    return stretch.swapaxes(-1, -2) @ block @ stretch + (other.swapaxes(-1, -2) * rest[..., None, :]) @ other


@compiled
def assemble(shape, force, stiff, unknown, places, gradient, data):
    """Add element forces sum_q B' force and stiffnesses sum_q B' stiff B to gradient and to the matrix's entries.

    shape (elements, points, nodes, 3) holds the shape functions' gradients, unknown (elements, 3 nodes) the numbers of
    the unknowns (-1: fixed), places (elements, 3 nodes, 3 nodes) where each entry stands in data (-1: nowhere).
    """
    nodes = shape.shape[2]
    local = np.empty((3 * nodes, 3 * nodes))
    load = np.empty(3 * nodes)
    row = np.empty((3, 9))
    for e in range(shape.shape[0]):
        local[:] = 0.0
        load[:] = 0.0
        for q in range(shape.shape[1]):
            p, c, g = force[e, q], stiff[e, q], shape[e, q]
            for a in range(nodes):
                for i in range(3):
                    load[3 * a + i] += g[a, 0] * p[3 * i] + g[a, 1] * p[3 * i + 1] + g[a, 2] * p[3 * i + 2]
                    for k in range(9):
                        row[i, k] = g[a, 0] * c[3 * i, k] + g[a, 1] * c[3 * i + 1, k] + g[a, 2] * c[3 * i + 2, k]
                for b in range(a + 1):
                    for i in range(3):
                        for k in range(3):
                            local[3 * a + i, 3 * b + k] += (row[i, 3 * k] * g[b, 0] + row[i, 3 * k + 1] * g[b, 1]
                                                            + row[i, 3 * k + 2] * g[b, 2])
        for a in range(3 * nodes):
            if unknown[e, a] < 0:
                continue
            gradient[unknown[e, a]] += load[a]
            for b in range(3 * nodes):
                if places[e, a, b] >= 0:
                    data[places[e, a, b]] += local[a, b] if a // 3 >= b // 3 else local[b, a]


def assemble_plainly(shape: Array, force: Array, stiff: Array, unknown: NDArray, places: NDArray, gradient: Array,
                     data: Array) -> None:
    """What `assemble` does, in numpy."""
    elements, points, nodes, _ = shape.shape
    strain = np.einsum("eqaj,ik->eqijak", shape, np.eye(3)).reshape(elements, 9 * points, 3 * nodes)
    load = (force.reshape(elements, 1, -1) @ strain)[:, 0]
    by_point = strain.reshape(elements, points, 9, 3 * nodes)
    local = np.swapaxes(strain, 1, 2) @ (stiff @ by_point).reshape(strain.shape)
    free, kept = unknown >= 0, places >= 0
    np.add.at(gradient, unknown[free], load[free])
    np.add.at(data, places[kept], local[kept])
