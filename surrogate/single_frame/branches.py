"""Draws of one frame's posterior where a diameter has several loads: importance draws about every branch.

Chains and one polynomial do not carry between branches of d and F that have nearly one signal. Each diameter of a fine
grid has its best touches, and about these a normal density of place and load, moved along with the diameter; draws of
their mixture are weighed by the map itself (Owen, Zhou, J. Am. Stat. Assoc. 95 (2000) 135).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surrogate.single_frame.diameter_profile import COUNTED, FREE, LOG_D, Ridge, Whitened, solutions
from surrogate.statistics.levenberg_marquardt import inverse
from touchcal.arrays import Array

DIAMETERS, DRAWS = 64, 6000  # diameters of the grid, and draws of the mixture
WIDER = 1.4  # factor of the standard deviations of the mixture, so that no tail of the posterior is left out
AGAIN = 1.0  # distance in standard deviations below which two touches of one diameter are the same
EVERYWHERE = 0.05  # part of the draws that all touches of the grid share evenly


@dataclass(frozen=True, eq=False)
class Branches:
    """The best touches of the diameters of a grid."""

    touch: Array  # (m, 4) as (x, y, log d, g)
    along: Array  # (m, 3) derivatives of (x, y, g) by log d
    root: Array  # (m, 3, 3) lower triangular root of their covariance at one diameter
    cost: Array  # (m,) half the squared residuals
    half: float  # half the step of the grid, in log d

    @property
    def several(self) -> bool:
        """Whether a diameter has two or more touches."""
        return len(np.unique(self.touch[:, LOG_D])) < len(self.touch)


@dataclass(frozen=True, eq=False)
class Weighed:
    """Draws of the mixture and their weights."""

    touch: Array  # (n, 4) as (x, y, log d, g)
    weight: Array  # (n,) of sum 1
    chi_squared: float  # least squared residual

    @property
    def effective(self) -> float:
        """Draws of their own that these are worth."""
        return float(1 / np.sum(self.weight**2))


def find(whitened: Whitened, ridge: Ridge, load: Callable[[Array], tuple[Array, Array]],
         within: Callable[[Array], Array]) -> Branches:
    """The branches between the diameters of a ridge; arguments as `diameter_profile.find`."""
    log_d = np.linspace(ridge.log_d[0], ridge.log_d[-1], DIAMETERS)
    touch, cost = solutions(whitened, ridge.counted[0], log_d, load, within)
    near = cost < cost.min() + COUNTED
    touch, cost = touch[near], cost[near]
    _, slope = whitened(touch)
    free = slope[..., FREE]
    normal = free.transpose(0, 2, 1) @ free + 1e-12 * np.eye(3)
    along = -np.linalg.solve(normal, free.transpose(0, 2, 1) @ slope[..., LOG_D, None])[..., 0]
    kept: list[int] = []
    for k in np.argsort(cost).tolist():
        same = [j for j in kept if touch[j, LOG_D] == touch[k, LOG_D]]
        off = touch[same][:, FREE] - touch[k, FREE]
        if not np.any(np.einsum("np,npq,nq->n", off, normal[same], off) < AGAIN**2):
            kept.append(k)
    root = np.asarray(np.linalg.cholesky(inverse(normal[kept])), np.float64)
    return Branches(touch[kept], np.asarray(along[kept], np.float64), root, cost[kept], float(log_d[1] - log_d[0]) / 2)


def draws(branches: Branches, residual: Callable[[Array], Array], log_prior: Callable[[Array], Array],
          rng: np.random.Generator) -> Weighed:
    """Draws of exp(log_prior(u) - |residual(u)|^2 / 2)."""
    size = np.linalg.det(branches.root) * np.exp(branches.cost.min() - branches.cost)
    share = (1 - EVERYWHERE) * size / size.sum() + EVERYWHERE / len(size)
    which = rng.choice(len(share), DRAWS, p=share)
    step = branches.half * rng.uniform(-1, 1, DRAWS)
    touch = branches.touch[which]
    touch[:, LOG_D] += step
    touch[:, FREE] += (branches.along[which] * step[:, None]
                       + WIDER * np.einsum("npq,nq->np", branches.root[which], rng.normal(size=(DRAWS, 3))))
    prior = log_prior(touch)
    inside = np.isfinite(prior)
    chi2 = np.full(DRAWS, np.inf)
    chi2[inside] = np.sum(residual(touch[inside]) ** 2, axis=1)
    log_weight = np.where(inside, prior - chi2 / 2, -np.inf) - _log_density(branches, share, touch)
    weight = np.exp(log_weight - log_weight.max())
    return Weighed(touch, weight / weight.sum(), float(chi2.min()))


def _log_density(branches: Branches, share: Array, touch: Array) -> Array:
    """(n,) log density of the mixture, but for a constant, at touches (n, 4)."""
    step = touch[:, None, LOG_D] - branches.touch[:, LOG_D]
    here = np.abs(step) <= branches.half * (1 + 1e-9)
    off = touch[:, None, FREE] - branches.touch[:, FREE] - step[..., None] * branches.along
    left = np.einsum("mpq,nmq->nmp", np.linalg.inv(branches.root) / WIDER, off)
    each = share / np.linalg.det(branches.root) * np.exp(-0.5 * np.sum(left**2, axis=2))
    return np.log(np.sum(np.where(here, each, 0.0), axis=1) + np.finfo(float).tiny)
