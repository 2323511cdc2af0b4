"""Variable projection for the hyperfoam law: moduli enter linearly and are solved for, only exponents are searched.

Exponents are ordered and kept a least gap apart: as two of them merge their moduli explode with opposite signs while
their sum stays the same, so nearer exponents describe nothing that a test can see.

Source: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, DOI 10.1137/0710036.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from touchcal.arrays import Array

# (N,) exponents -> (n, N) weighted design
Design = Callable[[Array], Array]
# (K, N) increasing positions in a grid
Combinations = NDArray[np.intp]
# (design (n, N), target (n,)) -> moduli (N,); least squares, or least squares under a constraint
Solve = Callable[[Array, Array, Array], Array]
# moduli (N,) of a solution -> (N, M) directions in which it is free to move, whatever the exponents
Within = Callable[[Array], Array]

# combinations kept while starts grow
_BEAM = 64
# relative step of the exponents at which a start stops
TOLERANCE = 1e-9
# relative step at which starts stop at first; of those that end within a share of the least gap of exponents from
# each other only the best goes on to TOLERANCE
_SCREENED, _SAME_END = 1e-4, 0.05
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
    # sum of squared weighted residuals near which each start ended, best first
    starts: tuple[float, ...]
    # evaluations of the design over all starts
    evaluations: int
    # (cost, mu_0 in Pa) of the least squares without the bound on single moduli; None where that kept it anyway
    unbounded: tuple[float, float] | None = None


def least_moduli(matrix: Array, target: Array, alpha: Array) -> Array:
    """Least-squares moduli (N,) of matrix (n, N) against target (n,), with columns scaled; `alpha` is not needed."""
    size = np.linalg.norm(matrix, axis=0)
    return np.linalg.lstsq(matrix / size, target, rcond=1e-13)[0] / size


def minimise(design: Design, slope: Design, target: Array, order: int, allowed: Exponents, starts: int = 8,
             solve: Solve = least_moduli, more: Sequence[Array] = (), tolerance: float = TOLERANCE,
             within: Within | None = None) -> Optimum:
    """Moduli and exponents with least ||target - design(alpha) mu||, from the best `starts` grid combinations.

    `slope` is d design/d alpha, column by column; it serves where the moduli are least squares, all of them or those
    `within` the directions that their bounds leave, else differences are taken. `more`: further starts (order,).
    `tolerance`: relative step at which a start stops. Deterministic; exponents stay as `allowed`.
    """
    calls = 0

    def residual(steps: Array) -> Array:
        nonlocal calls
        calls += 1
        alpha = exponents(steps, allowed)
        matrix = design(alpha)
        return matrix @ solve(matrix, target, alpha) - target

    def jacobian(steps: Array) -> Array:
        alpha = exponents(steps, allowed)
        matrix = design(alpha)
        moving = np.tril(np.ones((order, order))) * (np.cumsum(steps) <= _ceiling(order, allowed))[:, None]
        held = np.eye(order) if within is None else within(solve(matrix, target, alpha))
        return projected_slopes(matrix, slope(alpha), target, held) @ moving

    lowest = np.r_[allowed.low, np.full(order - 1, allowed.gap)]
    highest = np.r_[allowed.high, np.full(order - 1, allowed.high - allowed.low)]
    free = solve is least_moduli
    slopes: Any = jacobian if free or within else "2-point"

    def descend(steps: Array, to: float) -> tuple[float, Array]:
        out = least_squares(residual, steps, jac=slopes, bounds=(lowest, highest), gtol=1e-14,
                            xtol=to if free else 1e-7, ftol=1e-2 * to if free else 1e-8, max_nfev=200 if free else 60)
        return 2 * float(out.cost), out.x

    loose = []
    for start in [*_starts(design, target, order, allowed, starts, solve), *more]:
        steps = np.clip(np.diff(start, prepend=0.0), lowest + 1e-6, highest - 1e-6)
        loose.append(descend(steps, max(tolerance, _SCREENED)))
    loose.sort(key=lambda end: end[0])
    found = loose
    if free and tolerance < _SCREENED:
        each = [k for k, (_, steps) in enumerate(loose) if not any(
            np.abs(np.cumsum(steps - better)).max() < _SAME_END * allowed.gap for _, better in loose[:k])]
        found = sorted([descend(loose[k][1], tolerance) for k in each], key=lambda end: end[0])
    cost, alpha = found[0][0], exponents(found[0][1], allowed)
    return Optimum(solve(design(alpha), target, alpha), alpha, cost, tuple(c for c, _ in loose), calls)


def projected_slopes(matrix: Array, slope: Array, target: Array, held: Array) -> Array:
    """d(matrix mu - target)/d alpha, (n, N), where mu = held y, held (N, M), has the least-squares y.

    With Q R = matrix held, column j is P' a_j mu_j - Q R^-T held' e_j (a_j . r), a_j the slope of column j, r the
    residual and P' = 1 - Q Q'; the second part is left out where columns are dependent.
    """
    inside = matrix @ held
    size = np.linalg.norm(inside, axis=0)
    q, r = np.linalg.qr(inside / size)
    y = np.linalg.lstsq(r, q.T @ target, rcond=1e-13)[0]
    out = (slope - q @ (q.T @ slope)) * (held / size @ y)
    if held.size and np.abs(np.diag(r)).min() > 1e-10:
        miss = q @ (r @ y) - target
        out -= q @ np.linalg.solve(r.T, (held / size).T * (slope.T @ miss))
    return np.array(out, dtype=np.float64)


def _ceiling(order: int, allowed: Exponents) -> Array:
    """Largest value of each of `order` ordered exponents."""
    return allowed.high - allowed.gap * np.arange(order, dtype=float)[::-1]


def exponents(steps: Array, allowed: Exponents) -> Array:
    """Exponents (N,) from the first one and their gaps, the last ones kept a gap apart below the largest.

    Exactly 0, where the law has a limit only, is stepped past.
    """
    alpha = np.minimum(np.cumsum(steps), _ceiling(steps.size, allowed))
    return np.where(np.abs(alpha) < 1e-6, 1e-6, alpha)


def _starts(design: Design, target: Array, order: int, allowed: Exponents, count: int, solve: Solve) -> list[Array]:
    """The `count` combinations of grid exponents that fit best, grown by one exponent at a time from the best so far.
    """
    if not count:
        return []
    grid = np.array([a for a in _GRID if allowed.low < a < allowed.high])
    if grid.size < order:
        grid = np.linspace(allowed.low, allowed.high, order + 4)[1:-1]
    matrix = design(grid)
    q, r = np.linalg.qr(matrix)
    seen = q.T @ target

    def missed(choices: Combinations) -> Array:
        if solve is not least_moduli:
            return np.array([np.sum((r[:, c] @ solve(r[:, c], seen, grid[c]) - seen) ** 2) for c in choices])
        basis = np.linalg.qr(np.moveaxis((r / np.linalg.norm(r, axis=0))[:, choices], 1, 0))[0]
        return -np.sum(np.einsum("kgn,g->kn", basis, seen) ** 2, axis=1)

    choices = np.arange(grid.size)[:, None]
    for _ in range(order - 1):
        choices = _extended(_by(missed, choices)[:_BEAM], grid.size)
    return [grid[c] for c in _by(missed, choices)[:count]]


def _extended(choices: Combinations, size: int) -> Combinations:
    """Every increasing combination that adds one of `size` members to a combination, (K, N) -> (K', N + 1)."""
    grown = np.column_stack([np.repeat(choices, size, axis=0), np.tile(np.arange(size), len(choices))])
    another = (grown[:, :-1] != grown[:, -1:]).all(axis=1)
    return np.unique(np.sort(grown[another], axis=1), axis=0)


def _by(missed: Callable[[Combinations], Array], choices: Combinations) -> Combinations:
    return choices[np.argsort(missed(choices), kind="stable")]
