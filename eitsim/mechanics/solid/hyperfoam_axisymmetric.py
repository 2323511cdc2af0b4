"""Stress, tangent and energy of the hyperfoam law at many points, compiled; the numpy twin is in
eitsim.mechanics.solid.axisymmetric_assembly.

The formulas and the modes are those of `solid.stress`, `solid.stiffness`, `solid.damped` and `hyperfoam.energy`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from matcal.laws.hyperfoam import Hyperfoam
from touchcal.jit import compiled

Array = NDArray[np.float64]

# Sweeps of Jacobi's method over a matrix of three rows: more than rounding leaves any use for.
_SWEEPS = 12


def response(law: Hyperfoam, strain: Array, share: float = 1.0) -> tuple[Array, Array]:
    """First Piola stress (..., 5) and its derivative (..., 5, 5), negative modes scaled by share, at F = 1 + strain.

    strain (..., 5) has the parts rr, rz, zr, zz and hoop and must be admissible.
    """
    points = np.ascontiguousarray(strain).reshape(-1, 5)
    force, tangent = np.empty(points.shape), np.empty((*points.shape, 5))
    _respond(points, law.mu_Pa, law.alpha, law.beta, share, force, tangent)
    return force.reshape(strain.shape), tangent.reshape(*strain.shape, 5)


def density(law: Hyperfoam, strain: Array) -> Array:
    """Energy per reference volume (...) at F = 1 + strain (..., 5), which must be admissible."""
    points = np.ascontiguousarray(strain).reshape(-1, 5)
    out = np.empty(len(points))
    _densities(points, law.mu_Pa, law.alpha, law.beta, out)
    return out.reshape(strain.shape[:-1])


@compiled
def _densities(strain, mu, alpha, beta, out):
    for p in range(strain.shape[0]):
        rr, rz, zr, zz, hoop = strain[p]
        area = rr + zz + rr * zz - rz * zr
        mean = math.log1p(area) / 2
        half = math.atanh(math.hypot(rr - zz, rz + zr) / math.hypot(2 + rr + zz, rz - zr))
        x = (mean + half, mean - half, math.log1p(hoop))
        total = 0.0
        for i in range(mu.size):
            a, b = alpha[i], beta[i]
            inner = 0.0
            for k in range(4):
                z = a * x[k] if k < 3 else -a * b * (x[0] + x[1] + x[2])
                if abs(z) < 0.05:
                    rest = z * z * (1 / 2 + z * (1 / 6 + z * (1 / 24 + z * (1 / 120 + z * (1 / 720 + z / 5040)))))
                else:
                    rest = (math.expm1(z) if z < 700 else np.inf) - z
                if k < 3:
                    inner += rest
                elif b != 0:
                    inner += rest / b
            total += 2 * mu[i] / a**2 * inner
        out[p] = total


@compiled
def _respond(strain, mu, alpha, beta, share, force, tangent):
    x, tau, inverse, grown = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    block, vector, modes = np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 4))
    for p in range(strain.shape[0]):
        rr, rz, zr, zz, hoop = strain[p]
        mean = math.log1p(rr + zz + rr * zz - rz * zr) / 2
        turned, stretched = math.hypot(2 + rr + zz, zr - rz), math.hypot(rr - zz, rz + zr)
        half = math.atanh(stretched / turned)
        x[0], x[1], x[2] = mean + half, mean - half, math.log1p(hoop)
        cd, sd = ((2 + rr + zz) / turned, (zr - rz) / turned) if turned > 0 else (1.0, 0.0)
        cs, ss = ((rr - zz) / stretched, (rz + zr) / stretched) if stretched > 0 else (1.0, 0.0)
        root = math.sqrt(0.5)
        modes[0] = ((cd + cs) / 2, (ss - sd) / 2, (ss + sd) / 2, (cd - cs) / 2)
        modes[1] = ((cd - cs) / 2, (-ss - sd) / 2, (sd - ss) / 2, (cd + cs) / 2)
        modes[2] = (-ss * root, cs * root, cs * root, ss * root)
        modes[3] = (sd * root, cd * root, -cd * root, sd * root)
        tau[:] = 0.0
        block[:] = 0.0
        slope = 0.0
        for i in range(mu.size):
            a, b = alpha[i], beta[i]
            volume, bulk = 0.0, 0.0
            if b != 0:
                volume = math.expm1(-a * b * (x[0] + x[1] + x[2]))
                bulk = 2 * mu[i] * b * (volume + 1)
            for k in range(3):
                grown[k] = math.expm1(a * x[k])
                tau[k] += 2 * mu[i] / a * (grown[k] - volume)
                block[k, k] += 2 * mu[i] * (grown[k] + 1)
                for m in range(3):
                    block[k, m] += bulk
            larger, smaller, z = grown[0] + 1, grown[1] + 1, a * half
            if abs(z) < 0.05:
                near = 1 + z * z * (1 / 6 + z * z * (1 / 120 + z * z / 5040))
                slope += 2 * mu[i] * math.sqrt(larger * smaller) * near
            else:
                slope += mu[i] * (larger - smaller) / z
        for k in range(3):
            inverse[k] = math.exp(-x[k])
            block[k, k] -= tau[k]
        for k in range(3):
            for m in range(3):
                block[k, m] *= inverse[k] * inverse[m]
        middle, shrink = (tau[0] + tau[1]) / 2, math.exp(-2 * mean)
        ratio = 1 + half * half / 6 if half < 1e-4 else math.sinh(half) / half
        flip = shrink * (slope * math.cosh(half) / ratio - middle)
        twist = shrink * (middle - slope * half * math.tanh(half))
        if share != 1:
            flip *= share if flip < 0 else 1.0
            twist *= share if twist < 0 else 1.0
            _damp(block, vector, share)
        for i in range(4):
            force[p, i] = tau[0] * inverse[0] * modes[0, i] + tau[1] * inverse[1] * modes[1, i]
            across = block[2, 0] * modes[0, i] + block[2, 1] * modes[1, i]
            tangent[p, 4, i], tangent[p, i, 4] = across, across
            first = block[0, 0] * modes[0, i] + block[0, 1] * modes[1, i]
            second = block[1, 0] * modes[0, i] + block[1, 1] * modes[1, i]
            for j in range(4):
                tangent[p, i, j] = (first * modes[0, j] + second * modes[1, j] + flip * modes[2, i] * modes[2, j]
                                    + twist * modes[3, i] * modes[3, j])
        force[p, 4] = tau[2] * inverse[2]
        tangent[p, 4, 4] = block[2, 2]


@compiled
def _damp(block, vector, share):
    """Scale the negative part of a symmetric matrix of three rows by share, in place; Jacobi's method."""
    vector[:] = np.eye(3)
    turned = block.copy()
    for _ in range(_SWEEPS):
        size = abs(turned[0, 0]) + abs(turned[1, 1]) + abs(turned[2, 2])
        if abs(turned[0, 1]) + abs(turned[0, 2]) + abs(turned[1, 2]) <= 1e-16 * size:
            break
        for i in range(2):
            for j in range(i + 1, 3):
                if turned[i, j] == 0:
                    continue
                ratio = (turned[j, j] - turned[i, i]) / (2 * turned[i, j])
                t = (1.0 if ratio >= 0 else -1.0) / (abs(ratio) + math.hypot(ratio, 1.0))
                c = 1 / math.hypot(t, 1.0)
                s = t * c
                for k in range(3):
                    a, b = turned[k, i], turned[k, j]
                    turned[k, i], turned[k, j] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = turned[i, k], turned[j, k]
                    turned[i, k], turned[j, k] = c * a - s * b, s * a + c * b
                    a, b = vector[k, i], vector[k, j]
                    vector[k, i], vector[k, j] = c * a - s * b, s * a + c * b
    for m in range(3):
        value = turned[m, m]
        if value < 0:
            for i in range(3):
                for j in range(3):
                    block[i, j] += (share - 1) * value * vector[i, m] * vector[j, m]
