"""Displacements as Fourier series about an axis: their gradients at points of the meridian, and what acts on them.

u_r and u_z are sums of even harmonics of the angle, u_theta one of odd harmonics, and the other way round where nothing
is symmetric (see `arcs`); amplitudes (nodes, 3, harmonics) stand at the nodes of a mesh of the meridian. Gradients are
taken in the local frame (r, theta, z), parts row after row (rr, r theta, rz, theta r, ...), of which the 1st, 3rd, ...
are even in the angle and the others odd. Loops end on harmonics or angles, which lie next to each other in memory.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.harmonics.arcs import AngularQuadrature
from touchcal.arrays import Array
from touchcal.jit import compiled

Indices = NDArray[np.int64]

# Part of the gradient, part of u and which shape of (N_,r, N_,z, N/r): what does not, and what does, grow with m; the
# last number is the sign.
_STILL = ((0, 0, 0, 1), (1, 1, 2, -1), (2, 0, 1, 1), (3, 1, 0, 1), (4, 0, 2, 1), (5, 1, 1, 1), (6, 2, 0, 1),
          (8, 2, 1, 1))
_TURNING = ((1, 0, 2, -1), (4, 1, 2, 1), (7, 2, 2, -1))


@dataclass(frozen=True)
class Points:
    """Points of the meridian, each standing for a circle."""

    shape: Array  # (points, nodes, 3) N_,r, N_,z and N/r of the shape functions of its element
    nodes: Indices  # (points, nodes) node numbers
    # (points,) number of its circle
    circle: Indices
    circles: AngularQuadrature


def gradients(at: Points, amplitude: Array) -> Array:
    """Displacement gradients (points, 9, angles)."""
    out = np.empty((len(at.shape), 9, at.circles.weight.shape[1]))
    _gradients(at.shape, at.nodes, at.circle, at.circles.cosine, at.circles.sine, at.circles.orders, amplitude, out)
    return out


def forces(at: Points, stress: Array, amplitude: Array) -> Array:
    """Derivative by amplitudes, of the shape of the given ones, of sum stress : gradient; stress (points, 9, angles)
    with its weights."""
    out = np.zeros_like(amplitude)
    _forces(at.shape, at.nodes, at.circle, _last(at.circles.cosine), _last(at.circles.sine), at.circles.orders,
            stress, out)
    return out


def apply_tangent(at: Points, tangent: Array, amplitude: Array) -> Array:
    """The forces of stress = tangent : gradient, tangent (points, 45, angles) as in
    `eitsim.mechanics.solid.spatial_response`, with weights."""
    out = np.zeros_like(amplitude)
    _stiffened(at.shape, at.nodes, at.circle, at.circles.cosine, at.circles.sine, _last(at.circles.cosine),
               _last(at.circles.sine), at.circles.orders, tangent, amplitude, out)
    return out


def apply_isotropic_stiffness(at: Points, weight: Array, amplitude: Array) -> Array:
    """The forces of stress = weight (points,) times the gradient on whole circles."""
    out = np.zeros_like(amplitude)
    chosen = weight > 0
    _tied(at.shape[chosen], at.nodes[chosen], weight[chosen], at.circles.orders, amplitude, out)
    return out


def operators(shape: Array) -> tuple[Array, Array]:
    """Matrices B_0 and B_1 (points, 9, nodes, 3) that take amplitudes of harmonic m to gradients: B_0 + m B_1."""
    still, turning = (np.zeros((len(shape), 9, shape.shape[1], 3)) for _ in range(2))
    for out, entries in ((still, _STILL), (turning, _TURNING)):
        for part, of, by, sign in entries:
            out[:, part, :, of] = sign * shape[..., by]
    return still, turning


def _last(table: Array) -> Array:
    return np.ascontiguousarray(np.swapaxes(table, 1, 2))


@compiled
def _differentiate(shape, nodes, orders, amplitude, parts):
    parts[:] = 0.0
    for a in range(shape.shape[0]):
        r, z, h, n = shape[a, 0], shape[a, 1], shape[a, 2], nodes[a]
        for k in range(amplitude.shape[2]):
            m, across, around, up = orders[k], amplitude[n, 0, k], amplitude[n, 1, k], amplitude[n, 2, k]
            parts[0, k] += r * across
            parts[1, k] -= h * (m * across + around)
            parts[2, k] += z * across
            parts[3, k] += r * around
            parts[4, k] += h * (across + m * around)
            parts[5, k] += z * around
            parts[6, k] += r * up
            parts[7, k] -= h * m * up
            parts[8, k] += z * up


@compiled
def _collect(shape, nodes, orders, parts, out):
    for a in range(shape.shape[0]):
        r, z, h, n = shape[a, 0], shape[a, 1], shape[a, 2], nodes[a]
        for k in range(out.shape[2]):
            m = orders[k]
            out[n, 0, k] += r * parts[0, k] - h * m * parts[1, k] + z * parts[2, k] + h * parts[4, k]
            out[n, 1, k] += r * parts[3, k] - h * parts[1, k] + h * m * parts[4, k] + z * parts[5, k]
            out[n, 2, k] += r * parts[6, k] - h * m * parts[7, k] + z * parts[8, k]


@compiled
def _combine(parts, cosine, sine, out):
    """Values on a circle from amplitudes, tables (harmonics, angles); or back, tables (angles, harmonics)."""
    out[:] = 0.0
    for k in range(9):
        table = cosine if k % 2 == 0 else sine
        for m in range(parts.shape[1]):
            x = parts[k, m]
            for j in range(out.shape[1]):
                out[k, j] += x * table[m, j]


@compiled
def _gradients(shape, nodes, circle, cosine, sine, orders, amplitude, out):
    parts = np.empty((9, amplitude.shape[2]))
    for i in range(shape.shape[0]):
        _differentiate(shape[i], nodes[i], orders, amplitude, parts)
        _combine(parts, cosine[circle[i]], sine[circle[i]], out[i])


@compiled
def _forces(shape, nodes, circle, cosine, sine, orders, stress, out):
    parts = np.empty((9, out.shape[2]))
    for i in range(shape.shape[0]):
        _combine(stress[i], cosine[circle[i]], sine[circle[i]], parts)
        _collect(shape[i], nodes[i], orders, parts, out)


@compiled
def _stiffened(shape, nodes, circle, cosine, sine, cosine_last, sine_last, orders, tangent, amplitude, out):
    angles = cosine.shape[2]
    parts = np.empty((9, amplitude.shape[2]))
    slope, stress = np.empty((9, angles)), np.empty((9, angles))
    for i in range(shape.shape[0]):
        c = circle[i]
        _differentiate(shape[i], nodes[i], orders, amplitude, parts)
        _combine(parts, cosine[c], sine[c], slope)
        stress[:] = 0.0
        entry = 0
        for p in range(9):
            for j in range(angles):
                stress[p, j] += tangent[i, entry, j] * slope[p, j]
            entry += 1
            for q in range(p + 1, 9):
                for j in range(angles):
                    stress[p, j] += tangent[i, entry, j] * slope[q, j]
                    stress[q, j] += tangent[i, entry, j] * slope[p, j]
                entry += 1
        _combine(stress, cosine_last[c], sine_last[c], parts)
        _collect(shape[i], nodes[i], orders, parts, out)


@compiled
def _tied(shape, nodes, weight, orders, amplitude, out):
    parts = np.empty((9, amplitude.shape[2]))
    for i in range(shape.shape[0]):
        _differentiate(shape[i], nodes[i], orders, amplitude, parts)
        parts *= weight[i]
        _collect(shape[i], nodes[i], orders, parts, out)
