"""Levenberg-Marquardt on many small least-squares problems at once (Marquardt 1963)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array, Index

# (states (m, p), which problem each is of (m,)) -> residuals (m, r) and Jacobians (m, r, p)
Residuals = Callable[[Array, Index], tuple[Array, Array]]

# Damping: start, and the value that ends a problem; gain over the cost that ends one.
START, END, ENOUGH = 1e-3, 1e8, 1e-5
MET = 0.1  # distance, in standard deviations, from which two starts of one problem are taken to have met
TOGETHER = 96  # problems whose Jacobians are worked out together, to stay in the cache


@dataclass(frozen=True)
class Minimum:
    """Where every problem ended."""

    state: Array  # (n, p) states
    cost: Array  # (n,) half the squared residuals
    normal: Array  # (n, p, p) J'J
    residual: Array  # (n, r) residuals


def minimise(residuals: Residuals, start: Array, iterations: int,
             within: Callable[[Array], Array] = lambda state: state, problem: Index | None = None) -> Minimum:
    """Minimise n problems from states (n, p); `within` pulls trial states back to where they make sense. problem: which
    problem each start (n,) is of, where several are of one: of those that meet one goes on, and the others end with
    it."""
    state, damping, follows = start.copy(), np.full(len(start), START), np.arange(len(start))
    active, pairs = follows.copy(), _pairs(np.arange(len(start)) if problem is None else problem)
    cost, residual, gradient, normal = _squares(residuals, state, active)
    pairs = _meet(pairs, state, cost, normal, follows)
    active = active[follows[active] == active]
    for _ in range(iterations):
        trial = within(state[active] - _step(gradient[active], normal[active], damping[active]))
        new = _squares(residuals, trial, active)
        gain = cost[active] - new[0]
        better = gain > 0
        accepted = active[better]
        state[accepted] = trial[better]
        for whole, part in zip((cost, residual, gradient, normal), new, strict=True):
            whole[accepted] = part[better]
        damping[active] *= np.where(better, 0.1, 10.0)
        done = (better & (gain < ENOUGH * (1 + new[0]))) | (damping[active] > END)
        active = active[~done]
        pairs = _meet(pairs, state, cost, normal, follows)
        active = active[follows[active] == active]
        if not len(active):
            break
    while np.any(follows[follows] != follows):
        follows = follows[follows]
    return Minimum(state[follows], cost[follows], normal[follows], residual[follows])


def _pairs(problem: Index) -> Index:
    """(pairs, 2) starts of one problem."""
    order = np.argsort(problem, kind="stable")
    problem, found = problem[order], []
    for step in range(1, len(problem)):
        first = np.flatnonzero(problem[step:] == problem[:-step])
        if not len(first):
            break
        found.append(np.column_stack([order[first], order[first + step]]))
    return np.concatenate(found) if found else np.zeros((0, 2), np.intp)


def _meet(pairs: Index, state: Array, cost: Array, normal: Array, follows: Index) -> Index:
    """The pairs of starts that go on; of a pair that meets, that of the larger cost follows the other."""
    if not len(pairs):
        return pairs
    off = state[pairs[:, 0]] - state[pairs[:, 1]]
    met = pairs[np.sum((normal[pairs[:, 0]] @ off[..., None])[..., 0] * off, axis=1) < MET**2]
    larger = np.lexsort((met, cost[met]))[:, -1:] if len(met) else met[:, :1]
    worse, kept = (np.take_along_axis(met, one, axis=1)[:, 0] for one in (larger, 1 - larger))
    follows[worse] = kept
    return pairs[(follows[pairs] == pairs).all(axis=1)]


def inverse(normal: Array) -> Array:
    """Inverses of normal matrices (n, p, p), scaled to unit diagonals first, whatever the units of the states."""
    scale = 1 / np.sqrt(np.einsum("npp->np", normal))
    both = scale[:, :, None] * scale[:, None, :]
    return np.linalg.inv(normal * both) * both


def _squares(residuals: Residuals, state: Array, which: Index) -> tuple[Array, Array, Array, Array]:
    """Half the squared residuals (m,), residuals (m, r), gradients (m, p) and normal matrices (m, p, p)."""
    parts: list[tuple[Array, Array, Array, Array]] = []
    for begin in range(0, max(len(state), 1), TOGETHER):
        some = slice(begin, begin + TOGETHER)
        residual, jacobian = residuals(state[some], which[some])
        turned = jacobian.transpose(0, 2, 1)
        parts.append((0.5 * np.einsum("mr,mr->m", residual, residual), residual,
                      (turned @ residual[..., None])[..., 0], turned @ jacobian))
    cost, residual, gradient, normal = (np.concatenate(part) for part in zip(*parts, strict=True))
    return cost, residual, gradient, normal


def _step(gradient: Array, normal: Array, damping: Array) -> Array:
    damped = normal.copy()
    np.einsum("npp->np", damped)[...] *= 1 + damping[:, None]
    return np.asarray(np.linalg.solve(damped, gradient[..., None])[..., 0], np.float64)
