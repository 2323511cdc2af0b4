"""Derivatives of the foam's energy by its principal stretches at one point, for compiled loops over points.

With F = sum l_k u_k v_k', m, h = (x_i +- x_j)/2 of the logarithmic stretches x and tau of the law, the second
derivative of the energy w(l) splits into the stretch block w_kl and, for every pair of stretches, the flip mode
(w_i - w_j)/(l_i - l_j) on u_i v_j' + u_j v_i' and the twist mode (w_i + w_j)/(l_i + l_j) on u_i v_j' - u_j v_i'; both
are written with the law's divided difference, so coinciding stretches need no case. Source of the modes: Smith, de
Goes, Kim, ACM Trans. Graph. 38 (2019) 12, DOI 10.1145/3241041.
"""

import math

from matcal.laws.law import sinh_ratio
from touchcal.jit import compilable, compiled

compilable(sinh_ratio)
# Sweeps of Jacobi's method over a matrix of three rows, more than rounding leaves any use for; and the off-diagonal
# part that is rounding.
_SWEEPS, _ROUNDING = 12, 1e-16


@compiled
def differentiate(x, mean, half, slope, scale, force, block, rest, work):
    """Turn the Kirchhoff stresses in force (3,) and their derivatives in block (3, 3) at x (3,) into first and second
    derivatives by the stretches, and divided differences slope (pairs,) into those along flips, then twists, in rest
    (2 pairs,). mean, half (pairs,) belong to the first of the pairs (1, 2), (1, 3), (2, 3); scale multiplies negative
    curvatures; work is (3, 3, 3)."""
    pairs, inverse = len(half), work[0, 1]
    for pair in range(pairs):
        h, middle = half[pair], (force[pair // 2] + force[1 + (pair + 1) // 2]) / 2
        shrink = math.exp(-2 * mean[pair])
        rest[pair] = shrink * (slope[pair] * math.cosh(h) / sinh_ratio(h) - middle)
        rest[pairs + pair] = shrink * (middle - slope[pair] * h * math.tanh(h))
    for k in range(3):
        inverse[k] = math.exp(-x[k])
        block[k, k] -= force[k]
    for k in range(3):
        for m in range(3):
            block[k, m] *= inverse[k] * inverse[m]
        force[k] *= inverse[k]
    if scale != 1:
        for mode in range(2 * pairs):
            rest[mode] *= scale if rest[mode] < 0 else 1.0
        scale_negative_eigenvalues(block, scale, work[1], work[2])


@compiled
def scale_negative_eigenvalues(block, scale, turned, vector):
    """Scale the negative part of a symmetric matrix (3, 3) in place; turned, vector (3, 3) are room to work."""
    first = block[1, 1] * block[2, 2] - block[1, 2] * block[1, 2]
    second = block[0, 1] * block[2, 2] - block[0, 2] * block[1, 2]
    third = block[0, 1] * block[1, 2] - block[0, 2] * block[1, 1]
    if block[2, 2] > 0 and first > 0 and block[0, 0] * first - block[0, 1] * second + block[0, 2] * third > 0:
        return  # no part is negative
    for i in range(3):
        for j in range(3):
            turned[i, j] = block[i, j]
    diagonalise(turned, vector)
    for m in range(3):
        value = turned[m, m]
        if value < 0:
            for i in range(3):
                for j in range(3):
                    block[i, j] += (scale - 1) * value * vector[i, m] * vector[j, m]


@compiled
def diagonalise(a, vector):
    """Jacobi's rotations of a symmetric matrix (3, 3): eigenvalues come on its diagonal, eigenvectors as columns."""
    vector[:] = 0.0
    for k in range(3):
        vector[k, k] = 1.0
    for _ in range(_SWEEPS):
        size = abs(a[0, 0]) + abs(a[1, 1]) + abs(a[2, 2])
        if abs(a[0, 1]) + abs(a[0, 2]) + abs(a[1, 2]) <= _ROUNDING * size:
            break
        for i in range(2):
            for j in range(i + 1, 3):
                if a[i, j] == 0:
                    continue
                ratio = (a[j, j] - a[i, i]) / (2 * a[i, j])
                t = (1.0 if ratio >= 0 else -1.0) / (abs(ratio) + math.hypot(ratio, 1.0))
                c = 1 / math.hypot(t, 1.0)
                s = t * c
                for k in range(3):
                    one, other = a[k, i], a[k, j]
                    a[k, i], a[k, j] = c * one - s * other, s * one + c * other
                for k in range(3):
                    one, other = a[i, k], a[j, k]
                    a[i, k], a[j, k] = c * one - s * other, s * one + c * other
                    one, other = vector[k, i], vector[k, j]
                    vector[k, i], vector[k, j] = c * one - s * other, s * one + c * other
