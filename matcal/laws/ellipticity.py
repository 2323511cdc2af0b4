"""Strong ellipticity of a law at any principal stretches, in closed form.

With w(l) the energy in principal stretches, W is strongly elliptic where all (tau_i - tau_j)/(x_i - x_j) > 0 and, for
every choice of signs e, the matrix with w_ii on and e_i e_j w_ij + (w_i - e_i e_j w_j)/(l_i - e_i e_j l_j) off its
diagonal is strictly copositive. Rows and columns are scaled by l here, so that logarithmic stretches suffice.
Source: Dacorogna, Discrete Contin. Dyn. Syst. B 1 (2001) 257, DOI 10.3934/dcdsb.2001.1.257; copositivity of 3 x 3
matrices: Hadeler, Linear Algebra Appl. 49 (1983) 79, DOI 10.1016/0024-3795(83)90095-2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from matcal.laws.law import Law, sinh_ratio
from touchcal.arrays import Array

_FIRST, _SECOND = np.array([0, 0, 1]), np.array([1, 2, 2])
_SIGNS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))  # Signs e_i e_j of the pairs (1, 2), (1, 3), (2, 3).


def strongly_elliptic(law: Law, x: ArrayLike) -> NDArray[np.bool_]:
    """Whether the law is strongly elliptic, (...), at logarithmic principal stretches x (..., 3)."""
    x = np.asarray(x, dtype=float)
    tau, tangent = law.kirchhoff(x), law.tangent(x)
    half = (x[..., _FIRST] - x[..., _SECOND]) / 2
    slope = law.difference((x[..., _FIRST] + x[..., _SECOND]) / 2, half, x[..., ::-1])
    middle, cross = (tau[..., _FIRST] + tau[..., _SECOND]) / 2, tangent[..., _FIRST, _SECOND]
    same = cross + slope * np.cosh(half) / sinh_ratio(half) - middle
    opposite = middle - slope * half * np.tanh(half) - cross
    diagonal = np.einsum("...ii->...i", tangent) - tau
    fine = np.all(slope > 0, axis=-1) & np.all(diagonal > 0, axis=-1)
    for signs in _SIGNS:
        fine &= _copositive(diagonal, np.where(np.array(signs) > 0, same, opposite))
    return fine


def _copositive(diagonal: Array, off: Array) -> NDArray[np.bool_]:
    """Strict copositivity of symmetric matrices with positive diagonals (..., 3) and parts 12, 13, 23 in off (..., 3).
    Where a diagonal is not positive the answer means nothing."""
    root = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scaled = off / (root[..., _FIRST] * root[..., _SECOND])
    pairs = 1 + scaled
    triple = 1 + scaled.sum(axis=-1) + np.sqrt(2 * np.prod(np.maximum(pairs, 0.0), axis=-1))
    return np.all(pairs > 0, axis=-1) & (triple > 0)
