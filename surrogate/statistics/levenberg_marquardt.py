"""Levenberg-Marquardt on many small least-squares problems at once (Marquardt 1963)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array, Index

# (states (m, p), which problem each is of (m,)) -> residuals (m, r) and Jacobians (m, r, p)
Residuals = Callable[[Array, Index], tuple[Array, Array]]

# Damping: start, and the value that ends a problem; gain over the cost that ends one.
START, END, ENOUGH = 1e-3, 1e8, 1e-5


@dataclass(frozen=True)
class Minimum:
    """Where every problem ended."""

    state: Array  # (n, p) states
    cost: Array  # (n,) half the squared residuals
    normal: Array  # (n, p, p) J'J
    residual: Array  # (n, r) residuals


def minimise(residuals: Residuals, start: Array, iterations: int,
             within: Callable[[Array], Array] = lambda state: state) -> Minimum:
    """Minimise n problems from states (n, p); `within` pulls trial states back to where they make sense."""
    state, damping = start.copy(), np.full(len(start), START)
    active = np.arange(len(start))
    residual, jacobian = residuals(state, active)
    cost = 0.5 * np.sum(residual**2, axis=1)
    for _ in range(iterations):
        trial = within(state[active] - _step(residual[active], jacobian[active], damping[active]))
        new_residual, new_jacobian = residuals(trial, active)
        new_cost = 0.5 * np.sum(new_residual**2, axis=1)
        gain = cost[active] - new_cost
        better = gain > 0
        accepted = active[better]
        state[accepted], cost[accepted] = trial[better], new_cost[better]
        residual[accepted], jacobian[accepted] = new_residual[better], new_jacobian[better]
        damping[active] *= np.where(better, 0.1, 10.0)
        done = (better & (gain < ENOUGH * (1 + new_cost))) | (damping[active] > END)
        active = active[~done]
        if not len(active):
            break
    return Minimum(state, cost, jacobian.transpose(0, 2, 1) @ jacobian, residual)


def inverse(normal: Array) -> Array:
    """Inverses of normal matrices (n, p, p), scaled to unit diagonals first, whatever the units of the states."""
    scale = 1 / np.sqrt(np.einsum("npp->np", normal))
    both = scale[:, :, None] * scale[:, None, :]
    return np.linalg.inv(normal * both) * both


def _step(residual: Array, jacobian: Array, damping: Array) -> Array:
    normal = jacobian.transpose(0, 2, 1) @ jacobian
    gradient = (jacobian.transpose(0, 2, 1) @ residual[..., None])[..., 0]
    diagonal = np.einsum("npp->np", normal)
    damped = normal + (damping[:, None] * diagonal)[:, None, :] * np.eye(normal.shape[1])
    return np.linalg.solve(damped, gradient[..., None])[..., 0]
