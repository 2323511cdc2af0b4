"""Which punch made these multipoles: the posterior of (d, F) on a table, exact where it is broad or has branches.

Along the load g the strengths are taken as linear between the nodes of the table, so that the Gaussian likelihood of
measured strengths integrates over each interval in closed form. The prior is uniform over the d and F of the training
touches.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import log_ndtr

from surrogate.forward_map.forward_map import ForwardMap, by_material, log_strengths
from surrogate.forward_map.inversion.multipole_location import Located
from surrogate.forward_map.load_coordinates import to_touch, to_unknown, touch_slope
from touchcal.arrays import Array, Mask

DIAMETERS, LOADS = 48, 96
RESOLVED = 1.5  # spacings of the table that a standard deviation must exceed for the table to resolve it


@dataclass(frozen=True)
class Table:
    """Strengths of punches at the mean radius of the training touches."""

    d_mm: Array  # (D,) diameters, mm
    load: Array  # (G,) loads g
    p0: float  # pressure of the load, N/mm^2
    strengths: Array  # (D, G, orders) log |p_1 / V|, p_2 / p_1 ...

    @property
    def touch(self) -> Array:
        """(D (G - 1), 4) x = y = 0, d in mm and F in N of the middle of each interval."""
        middle = (self.load[1:] + self.load[:-1]) / 2
        log_d = np.repeat(np.log(self.d_mm), len(middle))
        return to_touch(np.column_stack([0 * log_d, 0 * log_d, log_d, np.tile(middle, len(self.d_mm))]), self.p0)


@dataclass(frozen=True)
class Posterior:
    """Posterior of the punch of each frame."""

    table: Table
    log_weight: Array  # (n, D, G - 1) log probability of each interval
    load: Array  # (n, D, G - 1) most probable load in each interval

    @property
    def weight(self) -> Array:
        """(n, D (G - 1)) probability of each interval."""
        return np.exp(self.log_weight).reshape(len(self.log_weight), -1)


@lru_cache(maxsize=8)
def make_table(forward: ForwardMap) -> Table:
    """The table over the diameters and forces of the training touches; one diameter where all are the same."""
    (_, d_lo, f_lo), (_, d_hi, f_hi) = forward.bounds
    d = np.linspace(d_lo, d_hi, DIAMETERS) if d_hi > 1.001 * d_lo else np.array([d_lo])
    load = np.linspace(np.arcsinh(f_lo / (d_hi**2 * forward.p0)), np.arcsinh(f_hi / (d_lo**2 * forward.p0)), LOADS)
    unknown = np.zeros((len(d), len(load), 4))
    unknown[..., 0] = np.hypot(*forward.sd[:2])
    unknown[..., 2], unknown[..., 3] = np.log(d)[:, None], load
    return Table(d, load, forward.p0, log_strengths(forward, unknown.reshape(-1, 4)).reshape(len(d), len(load), -1))


def posterior(forward: ForwardMap, table: Table, located: Located) -> Posterior:
    """Posterior of the punches of located touches; the scatter of the training strengths counts as error, and what the
    material makes of those of the mean touch."""
    scatter = np.diag([float(np.median(process.noise)) for process in forward.strengths])
    of_card = by_material(forward, forward.mean[None])[0]
    scatter = scatter + of_card @ of_card.T
    precision = np.linalg.inv(located.covariance + scatter)
    miss = table.strengths[None, :, :-1] - located.strengths[:, None, None]
    step = np.diff(table.strengths, axis=1)[None]
    weighed = np.einsum("npq,xijq->nijp", precision, step, optimize=True)
    curvature = np.maximum(np.einsum("nijp,xijp->nij", weighed, step), np.finfo(float).tiny)
    best = -np.einsum("nijp,nijp->nij", weighed, miss) / curvature
    cost = np.einsum("nijp,npq,nijq->nij", miss, precision, miss, optimize=True) - best**2 * curvature
    width = 1 / np.sqrt(curvature)
    load = table.load[:-1] + np.clip(best, 0, 1) * np.diff(table.load)
    log_weight = -0.5 * cost + _log_mass(-best / width, (1 - best) / width) + np.log(width)
    log_weight += _log_prior(forward, table)
    top = log_weight.max(axis=(1, 2), keepdims=True)
    total = np.log(np.sum(np.exp(log_weight - top), axis=(1, 2), keepdims=True))
    return Posterior(table, log_weight - top - total, load)


def _log_prior(forward: ForwardMap, table: Table) -> Array:
    """(D, G - 1) log of the density of (d, g) that is uniform in (d, F), by the trapezoidal rule in d."""
    touch, (lowest, highest) = table.touch, forward.bounds[:, 2]
    density = np.log(touch_slope(to_unknown(touch, table.p0), table.p0)[:, 3, 3])
    density[(touch[:, 3] < lowest) | (touch[:, 3] > highest)] = -np.inf
    density = density.reshape(len(table.d_mm), -1)
    if len(density) > 1:
        density[[0, -1]] += np.log(0.5)
    return density


def _log_mass(lower: Array, upper: Array) -> Array:
    """log of the normal probability between two bounds, lower < upper, safe in both tails."""
    flip = lower > 0
    lower, upper = np.where(flip, -upper, lower), np.where(flip, -lower, upper)
    larger, smaller = log_ndtr(upper), log_ndtr(lower)
    return larger + np.log1p(-np.exp(np.minimum(smaller - larger, -1e-300)))


def moments(found: Posterior, values: Array) -> tuple[Array, Array]:
    """Mean (n, k) and covariance (n, k, k) of values (D (G - 1), k) of the table's intervals."""
    weight, middle, k = found.weight, values.mean(axis=0), values.shape[1]
    centred = values - middle
    mean = weight @ centred
    second = weight @ (centred[:, :, None] * centred[:, None, :]).reshape(len(values), k * k)
    covariance = second.reshape(-1, k, k) - mean[:, :, None] * mean[:, None, :]
    diagonal = np.arange(k)
    covariance[:, diagonal, diagonal] = np.maximum(covariance[:, diagonal, diagonal], 0.0)
    return middle + mean, covariance


def resolved(found: Posterior) -> Mask:
    """(n,) whether the posterior is broad enough for the table, in diameter or in load."""
    table = found.table
    by_d, by_load = np.exp(found.log_weight).sum(axis=2), np.exp(found.log_weight).sum(axis=1)
    broad = _sd(by_load, (table.load[1:] + table.load[:-1]) / 2) > 2 * RESOLVED * (table.load[1] - table.load[0])
    if len(table.d_mm) > 1:
        broad |= _sd(by_d, table.d_mm) > RESOLVED * (table.d_mm[1] - table.d_mm[0])
    return broad


def _sd(weight: Array, values: Array) -> Array:
    mean = weight @ values
    return np.sqrt(np.maximum(weight @ values**2 - mean**2, 0.0))


def starts(found: Posterior, bands: int) -> Array:
    """(n, bands, 2) most probable (d, g) in each of some bands of loads, which part the branches of one signal."""
    n, groups = len(found.log_weight), np.array_split(np.arange(len(found.table.load) - 1), bands)
    out = np.empty((n, bands, 2))
    for k, group in enumerate(groups):
        flat = found.log_weight[:, :, group].reshape(n, -1)
        best = np.argmax(flat, axis=1)
        out[:, k, 0] = found.table.d_mm[best // len(group)]
        out[:, k, 1] = found.load[:, :, group].reshape(n, -1)[np.arange(n), best]
    return out
