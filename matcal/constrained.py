"""Moduli under Drucker stability: the least squares of variable projection with linear inequalities.

With nu = 0 the Kirchhoff tangent is diagonal, 2 sum mu_i lambda^alpha_i on each axis, so a law is Drucker stable where
h(lambda) = sum mu_i lambda^alpha_i > 0 at every principal stretch: for given exponents that is linear in the moduli.
Source: Lawson & Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance programming).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from matcal.curves import Curve
from matcal.varpro import Solve, least_moduli

Array = NDArray[np.float64]

STABLE = ("drucker",)
# stretches at which h is held, and its least value there as a share of the unconstrained mu_0
_GRID, _FLOOR = 120, 0.005


def stable_moduli(criterion: str, curves: Sequence[Curve], nu: float) -> Solve:
    """A `Solve` whose moduli satisfy `criterion` at every principal stretch that the curves reach.

    Raises ValueError for a criterion or a nu for which this is not built.
    """
    if criterion not in STABLE:
        raise ValueError(f"--stable {criterion} is not available; known: {', '.join(STABLE)}. Leave it out and see "
                         "`matcal check` for where the law is elliptic.")
    if nu != 0:
        raise ValueError(f"--stable {criterion} is built for nu = 0 only, got nu = {nu:g}. Leave out --poisson.")
    low, high = _reached(curves)
    stretches = np.linspace(low, high, _GRID)

    def solve(matrix: Array, target: Array, alpha: Array) -> Array:
        free = least_moduli(matrix, target, alpha)
        return nearest(matrix, free, np.exp(stretches[:, None] * alpha), _FLOOR * abs(free.sum()))

    return solve


def nearest(matrix: Array, free: Array, rows: Array, floor: float) -> Array:
    """Moduli nearest to `free` in |matrix (mu - free)| with rows @ mu >= floor."""
    short = floor - rows @ free
    if np.all(short <= 0):
        return free
    size = np.linalg.norm(matrix, axis=0)
    r = np.linalg.qr(matrix / size)[1]
    bent = np.linalg.solve(r.T, (rows / size).T)
    columns = np.vstack([bent, short])
    scale = np.linalg.norm(columns[:-1], axis=0)
    goal = np.r_[np.zeros(free.size), 1.0]
    weight, _ = nnls(columns / scale, goal, maxiter=3000)
    miss = (columns / scale) @ weight - goal
    return free - np.linalg.solve(r, miss[:-1] / miss[-1]) / size


def _reached(curves: Sequence[Curve]) -> tuple[float, float]:
    """Least and largest logarithmic principal stretch of all curves, 0 among them."""
    ends = [0.0]
    for curve in curves:
        e, kind = curve.experiment.strain, curve.experiment.kind
        x = {"shear": np.arcsinh(e / 2), "volumetric": np.log(np.maximum(e, 1e-9)) / 3}.get(kind, np.log1p(e))
        ends += [float(x.min()), float(x.max())] + ([-float(x.max()), -float(x.min())] if kind == "shear" else [])
    return min(ends), max(ends)
