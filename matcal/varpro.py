"""Variable projection for the hyperfoam law: moduli enter linearly and are solved for, only exponents are searched.

Exponents are ordered and kept a least gap apart: as two of them merge their moduli explode with opposite signs while
their sum stays the same, so nearer exponents describe nothing that a test can see.

Source: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, DOI 10.1137/0710036.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
# (N,) exponents -> (n, N) weighted design
Design = Callable[[Array], Array]
# (design (n, N), target (n,)) -> moduli (N,); least squares, or least squares under a constraint
Solve = Callable[[Array, Array, Array], Array]

# exponents from which starts are combined
_GRID = np.array([-12.0, -8.0, -5.0, -3.0, -1.5, -0.5, 0.3, 0.9, 2.0, 3.5, 5.0, 7.5, 11.0, 16.0, 23.0])


@dataclass(frozen=True)
class Exponents:
    """Exponents that a search may take."""

    # least and largest exponent
    low: float
    high: float
    # least distance between two
    gap: float


@dataclass(frozen=True)
class Optimum:
    """Best of all starts."""

    # (N,) moduli, Pa
    mu_Pa: Array
    # (N,) exponents, increasing
    alpha: Array
    # sum of squared weighted residuals
    cost: float
    # sum of squared weighted residuals that each start ended in, best first
    starts: tuple[float, ...]
    # evaluations of the design over all starts
    evaluations: int


def least_moduli(matrix: Array, target: Array, alpha: Array) -> Array:
    """Least-squares moduli (N,) of matrix (n, N) against target (n,), with columns scaled; `alpha` is not needed."""
    size = np.linalg.norm(matrix, axis=0)
    return np.linalg.lstsq(matrix / size, target, rcond=1e-13)[0] / size


def minimise(design: Design, target: Array, order: int, allowed: Exponents, starts: int = 8,
             solve: Solve = least_moduli) -> Optimum:
    """Moduli and exponents with least ||target - design(alpha) mu||, from the best `starts` grid combinations.

    Deterministic; exponents stay as `allowed`.
    """
    calls = 0

    def residual(steps: Array) -> Array:
        nonlocal calls
        calls += 1
        alpha = _exponents(steps, allowed)
        matrix = design(alpha)
        return matrix @ solve(matrix, target, alpha) - target

    lowest = np.r_[allowed.low, np.full(order - 1, allowed.gap)]
    highest = np.r_[allowed.high, np.full(order - 1, allowed.high - allowed.low)]
    found = []
    for start in _starts(design, target, order, allowed, starts):
        steps = np.clip(np.diff(start, prepend=0.0), lowest + 1e-6, highest - 1e-6)
        out = least_squares(residual, steps, bounds=(lowest, highest), x_scale=np.full(order, 1.0), xtol=1e-9,
                            ftol=1e-11, gtol=1e-14, max_nfev=200)
        found.append((2 * float(out.cost), _exponents(out.x, allowed)))
    found.sort(key=lambda pair: pair[0])
    cost, alpha = found[0]
    return Optimum(solve(design(alpha), target, alpha), alpha, cost, tuple(c for c, _ in found), calls)


def _exponents(steps: Array, allowed: Exponents) -> Array:
    """Exponents from the first one and their gaps, the last ones kept a gap apart below the largest.

    Exactly 0, where the law has a limit only, is stepped past.
    """
    alpha = np.minimum(np.cumsum(steps), allowed.high - allowed.gap * np.arange(steps.size)[::-1])
    return np.where(np.abs(alpha) < 1e-6, 1e-6, alpha)


def _starts(design: Design, target: Array, order: int, allowed: Exponents, count: int) -> list[Array]:
    """The `count` combinations of grid exponents that fit best."""
    grid = np.array([a for a in _GRID if allowed.low < a < allowed.high])
    matrix = design(grid)
    matrix = matrix / np.linalg.norm(matrix, axis=0)
    q, r = np.linalg.qr(matrix)
    seen = q.T @ target
    choices = [list(c) for c in combinations(range(grid.size), order)]
    explained = [np.sum((np.linalg.qr(r[:, c])[0].T @ seen) ** 2) for c in choices]
    best = np.argsort(explained)[::-1][:count]
    return [grid[choices[k]] for k in best]
