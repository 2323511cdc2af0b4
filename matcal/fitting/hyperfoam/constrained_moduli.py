"""Moduli under linear inequalities: the least squares of variable projection where some moduli are no material.

For given exponents everything that a law must satisfy here is linear in the moduli: that none of them explodes
(|mu_i| <= MOST mu_0, which makes mu_0 positive as well), and that it is stable at a state and in a direction.
Source: Lawson & Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance programming).
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import nnls

from matcal.fitting.hyperfoam.order_selection import EXPLODING as MOST
from matcal.fitting.hyperfoam.variable_projection import Solve, least_moduli
from touchcal.arrays import Array
from touchcal.errors import NotConverged

Rows = Callable[[Array], Array]  # (N,) exponents -> (m, N) rows whose product with the moduli keeps a floor

FLOOR = 0.005  # least value of a stability row per mu_0
_ON = 1e-9  # value of a row over its terms up to which moduli lie on its bound


def bounded_moduli(matrix: Array, target: Array, alpha: Array) -> Array:
    """Least-squares moduli (N,) of matrix (n, N) against target (n,) with |mu_i| <= MOST mu_0."""
    free = least_moduli(matrix, target, alpha)
    return nearest(matrix, free, bound_rows(alpha), 0.0)


def within_bounds(mu: Array) -> Array:
    """(N, M) orthonormal directions in which moduli (N,) of `bounded_moduli` are free: across the bounds that they lie
    on."""
    rows = bound_rows(mu)
    on = rows @ mu <= _ON * (np.abs(rows) @ np.abs(mu))
    return null_space(rows[on]) if on.any() else np.eye(mu.size)


def stable_moduli(rows: Rows) -> Solve:
    """A `Solve` with `rows`(alpha) @ mu at least `least`(rows) times the unconstrained |mu_0|, and |mu_i| <= MOST mu_0.
    """
    def solve(matrix: Array, target: Array, alpha: Array) -> Array:
        free, held = least_moduli(matrix, target, alpha), rows(alpha)
        floor = np.r_[abs(free.sum()) * least(held), np.zeros(2 * alpha.size)]
        return nearest(matrix, free, np.vstack([held, bound_rows(alpha)]), floor)

    return solve


def least(rows: Array) -> Array:
    """(m,) least values of stability rows (m, N) per mu_0: a share, of the largest term where all terms fade."""
    return FLOOR * np.minimum(1.0, np.abs(rows).max(axis=1))


def bound_rows(alpha: Array) -> Array:
    """(2 N, N) rows that are >= 0 where |mu_i| <= MOST mu_0."""
    n = alpha.size
    return MOST * np.ones((2 * n, n)) + np.vstack([np.eye(n), -np.eye(n)])


def nearest(matrix: Array, free: Array, rows: Array, floor: Array | float) -> Array:
    """Moduli nearest to `free` in |matrix (mu - free)| with rows @ mu >= floor; zeros where no moduli satisfy that.
    Raises NotConverged where the inner non-negative least squares do not end."""
    short = floor - rows @ free
    if np.all(short <= 0):
        return free
    size = np.linalg.norm(matrix, axis=0)
    r = np.linalg.qr(matrix / size)[1]
    r = r + 1e-13 * np.diag(np.where(np.diag(r) < 0, -1.0, 1.0))
    length = np.maximum(np.linalg.norm(rows / size, axis=1), 1e-300)
    bent = np.linalg.solve(r.T, (rows / size / length[:, None]).T)
    columns = np.vstack([bent, short / length])
    scale = np.linalg.norm(columns[:-1], axis=0)
    goal = np.r_[np.zeros(free.size), 1.0]
    unit = float(np.abs(columns[-1] / scale).max())
    columns = np.vstack([columns[:-1], columns[-1:] / unit]) / scale
    try:
        weight, _ = nnls(columns, goal, maxiter=3000)
    except RuntimeError:
        raise NotConverged("moduli under inequalities: the non-negative least squares did not end. Lower the order.",
                           estimate=free) from None
    miss = columns @ weight - goal
    if abs(miss[-1]) < 1e-12:
        return np.zeros_like(free)
    return free - np.linalg.solve(r, unit * miss[:-1] / miss[-1]) / size
