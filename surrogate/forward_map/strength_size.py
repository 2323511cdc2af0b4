"""A positive size of the multipole strengths of a touch, smooth in the punch whatever the signs of the strengths.

Strengths are learned over it. Each of them may pass zero, as the dipole does where a contact shunts the skin as much as
its strain opens it; the size does not, so that errors over it stay those of a signal.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from touchcal.arrays import Array

PUNCH = 2  # inputs that it bends with: log d and g; the others move its logarithm linearly
HELD = 1e-3  # part of a squared weight that counts as misfit, so that inputs that differ by rounding move nothing


@dataclass(frozen=True, eq=False)
class Size:
    """size(x) = exp(b0 + b.u + sum_ij c_ij u_i u_j), u = x - centre, i <= j < PUNCH, a unit of strength per N."""

    centre: Array  # (q,) mean training input
    weights: Array  # (1 + q + PUNCH (PUNCH + 1) / 2,) b0, b, c

    @cached_property
    def curvature(self) -> Array:
        """(PUNCH, PUNCH) second derivatives of the logarithm by the first inputs."""
        half = np.zeros((PUNCH, PUNCH))
        half[np.triu_indices(PUNCH)] = self.weights[1 + len(self.centre):]
        return half + half.T


def fit(x: Array, size: Array) -> Size:
    """Least squares of the logarithm of sizes (n,) > 0 at inputs (n, q), of which the first are log d and g."""
    centre = x.mean(axis=0)
    regressors = _regressors(x - centre)
    normal = regressors.T @ regressors + HELD * np.eye(regressors.shape[1])
    return Size(centre, np.asarray(np.linalg.solve(normal, regressors.T @ np.log(size)), dtype=np.float64))


def at(size: Size, x: Array) -> tuple[Array, Array]:
    """Sizes (n,) at inputs (n, q), and the gradients (n, q) of their logarithms."""
    u, slope = x - size.centre, size.weights[1:1 + x.shape[1]]
    bent = u[:, :PUNCH] @ size.curvature
    gradient = np.repeat(slope[None], len(x), axis=0)
    gradient[:, :PUNCH] += bent
    return np.exp(size.weights[0] + u @ slope + 0.5 * np.sum(bent * u[:, :PUNCH], axis=1)), gradient


def _regressors(u: Array) -> Array:
    products = [u[:, i] * u[:, j] for i, j in zip(*np.triu_indices(PUNCH), strict=True)]
    return np.column_stack([np.ones(len(u)), u, *products])
