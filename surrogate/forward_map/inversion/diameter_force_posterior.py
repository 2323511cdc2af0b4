"""Which punch made these multipoles: the posterior of (d, F) on all branches of a signal, away from the rim.

The strengths of a located touch have a normal likelihood under those of a table of punches, whose own errors count node
by node. Along the load g the strengths are taken as linear between nodes, so that the likelihood integrates over each
interval in closed form however narrow it is. The prior is uniform over the F of the training touches; over their d too,
or, where training rows share a few diameters, almost all of it on these. Means are over this posterior. Intervals hold
every punch whose likelihood, maximised over what else is unknown, is not too far below the largest: of a posterior that
several punches share, the part that is cut off would always be that of the smallest or largest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import log_ndtr, ndtri

from surrogate.data.sensor_ring import Ring, radial
from surrogate.forward_map.forward_map import ForwardMap, places_at, strength_covariance, strengths
from surrogate.forward_map.inversion.multipole_location import Located
from surrogate.forward_map.load_coordinates import force
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array, Index, Mask
from touchcal.jit import compiled

# Diameters of the table where none is known, and besides known ones; loads of each.
DIAMETERS, OTHERS, LOADS = 48, 16, 96
RESOLVED = 1.5  # spacings of the diameters that a standard deviation must exceed for the table to resolve it
FITS = 25.0  # squared distance in standard deviations from which a punch of the table made the strengths no more
RULED_OUT = 30.0  # log probability below the largest from which no search begins in a band of loads
DRAWS = 1000  # punches in equal steps of probability that stand for the posterior of a frame
# Squares of the radii of the table over that of the interior; between them strengths are taken as parabolas.
RADII = np.array([0.0, 0.5, 1.0])


@dataclass(frozen=True, eq=False)
class Table:
    """Strengths of punches at some radii."""

    d_mm: Array  # (D,) diameters, mm: the known punches, then others in equal steps
    known: int  # how many of them are known
    load: Array  # (D, G) loads g
    force_N: Array  # (D, G) their forces
    strengths: Array  # (RADII, D, G, orders) p_n over the unit
    covariance: Array  # (RADII, D, G, orders, orders) of their errors, and by what is left open of the material
    unit: Array  # (orders,) RMS of p_n over the table, V
    ring: Ring
    interior: float  # radius of the interior over the ring's
    log_diameter: Array  # (D,) log of the prior of each diameter
    log_prior: Array  # (D, G - 1) of each interval

    @property
    def touch(self) -> Array:
        """(D, G, 2) d, mm, and F, N, of the nodes."""
        return np.stack(np.broadcast_arrays(self.d_mm[:, None], self.force_N), axis=-1)


@dataclass(frozen=True)
class Posterior:
    """Posterior of the punch of each frame."""

    table: Table
    radial: Array  # (n, RADII) weights of the table's radii at the places
    log_weight: Array  # (n, D, G - 1) log probability of each interval
    along: Array  # (n, D, G - 1) mean place along each interval, 0 to 1
    spread: Array  # (n, D, G - 1) standard deviation of that place
    # (2, n, D, G - 1) places on each interval, 0 to 1, between which its punches are likely; NaN where none is
    likely: Array
    cost: Array  # (n,) least squared distance of the strengths from the table's, in standard deviations
    profile: Array  # (n, D) -2 log of the largest likelihood of each diameter
    profile_N: Array  # (n, D) the forces that it is at

    @property
    def deviance(self) -> Array:
        """(n,) -2 log of the largest likelihood of the table's punches."""
        return np.asarray(self.profile.min(axis=1), np.float64)

    def some(self, rows: Mask) -> Posterior:
        """Those of some frames."""
        return Posterior(self.table, self.radial[rows], self.log_weight[rows], self.along[rows], self.spread[rows],
                         self.likely[:, rows], self.cost[rows], self.profile[rows], self.profile_N[rows])

    @cached_property
    def draws(self) -> tuple[Index, Array]:
        """(n, DRAWS) intervals of punches in equal steps of probability, as flat positions, and places on these."""
        flat = [part.reshape(len(self.cost), -1) for part in (np.exp(self.log_weight), self.along, self.spread)]
        reached, steps = np.cumsum(flat[0], axis=1), (np.arange(DRAWS) + 0.5) / DRAWS
        which = np.array([np.searchsorted(row, steps * row[-1]) for row in reached])
        weight, along, spread, up_to = (np.take_along_axis(part, which, axis=1) for part in (*flat, reached))
        share = 1 - (up_to - steps * reached[:, -1:]) / weight
        return which, np.clip(along + spread * ndtri(np.clip(share, 1e-9, 1 - 1e-9)), 0.0, 1.0)


@lru_cache(maxsize=8)
def make_table(forward: ForwardMap) -> Table:
    """The table over the diameters and forces of the training touches; one diameter where all are the same."""
    d_lo, d_hi = forward.bounds[:, 1]
    known, count = forward.known_mm, OTHERS if len(forward.known_mm) else DIAMETERS
    others = np.linspace(d_lo, d_hi, count) if d_hi > 1.001 * d_lo else np.array([d_lo])
    diameter = _diameter_prior(forward, len(others))
    # an end of the trapezoidal rule counts half, and is as likely as the others
    each = np.r_[diameter[:len(known)], np.full(len(others), diameter[len(known):].max())]
    return table_of(forward, np.r_[known, others], len(known), diameter, np.log(each))


def table_of(forward: ForwardMap, d: Array, known: int, part: Array, log_diameter: Array) -> Table:
    """The table over the forces of the training touches at diameters (D,), mm, which stand for these parts (D,) of the
    prior, of logarithms (D,) at each."""
    f_lo, f_hi = forward.bounds[:, 2]
    ends = np.arcsinh(np.array([f_lo, f_hi]) / (d[:, None] ** 2 * forward.p0))
    load = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * np.linspace(0, 1, LOADS)
    unknown = np.zeros((len(RADII), *load.shape, 4))
    unknown[..., :2] = places_at(forward, np.sqrt(RADII))[:, None, None]
    unknown[..., 2], unknown[..., 3] = np.log(d)[:, None], load
    flat, shape = unknown.reshape(-1, 4), (*unknown.shape[:3], -1)
    force_N = force(np.log(d)[:, None], load, forward.p0)
    log_prior = np.log(part[:, None] * np.diff(force_N, axis=1) / (f_hi - f_lo))
    found = strengths(forward, flat)
    unit = np.sqrt(np.mean(found**2, axis=0))
    covariance = strength_covariance(forward, flat) / np.outer(unit, unit)
    return Table(d, known, load, force_N, (found / unit).reshape(shape),
                 np.ascontiguousarray(covariance.reshape(*shape, len(unit))), unit,
                 forward.ring, forward.interior, log_diameter, log_prior)


def _diameter_prior(forward: ForwardMap, others: int) -> Array:
    """(D,) prior of the known diameters, as the training rows leave it, and of others by the trapezoidal rule."""
    uniform = np.ones(others)
    uniform[[0, -1]] = 0.5 if others > 1 else 1.0
    known = len(forward.known_mm)
    other = 1 / (forward.rows + 2) if known else 1.0
    return np.r_[np.full(known, (1 - other) / max(known, 1)), other * uniform / uniform.sum()]


def posterior(table: Table, located: Located, inner: Posterior | None = None) -> Posterior:
    """Posterior of the punches of located touches; of those outside the training range, likely as those of the `inner`
    posterior are."""
    radial = _radial(table, located.place_mm)
    nearest = np.abs(_square(table, located.place_mm)[:, None] - RADII).argmin(axis=1)
    # of the sum of both covariances, that of the signal in its inverse alone, which may be singular
    part, axes = np.linalg.eigh(located.precision * np.outer(table.unit, table.unit))
    root = np.ascontiguousarray((axes * np.sqrt(np.maximum(part, 0.0))[:, None]).transpose(0, 2, 1))
    best, curvature, cost, size = _along_intervals(table.strengths, table.covariance, radial, nearest, root,
                                                   located.strengths / table.unit)
    width = 1 / np.sqrt(curvature)
    mass = _log_mass(-best / width, (1 - best) / width)
    log_weight = -0.5 * (cost + size) + mass + np.log(width) + table.log_prior
    log_weight -= log_weight.max(axis=(1, 2), keepdims=True)
    log_weight -= np.log(np.sum(np.exp(log_weight), axis=(1, 2), keepdims=True))
    nearest = cost + ((best - np.clip(best, 0, 1)) / width) ** 2
    added = size - 2 * table.log_diameter[:, None]
    least = np.min(nearest + added, axis=(1, 2)) if inner is None else (
        inner.deviance - 2 * inner.table.log_diameter.max())
    likely = _likely(nearest, cost, added, best, width, least)
    along = np.clip(best, 0, 1)
    force_N = table.force_N[:, :-1] + along * np.diff(table.force_N, axis=1)
    at = np.argmin(nearest + size, axis=2)[..., None]
    profile, profile_N = (np.take_along_axis(one, at, axis=2)[..., 0] for one in (nearest + size, force_N))
    return Posterior(table, radial, log_weight, *_truncated(best, width, mass), likely, nearest.min(axis=(1, 2)),
                     profile, profile_N)


@compiled
def _along_intervals(strengths: Array, covariance: Array, radial: Array, nearest: Index, root: Array,
                     located: Array) -> tuple[Array, Array, Array, Array]:
    """Along each interval of the loads (n, D, G - 1), of the squared distance from located strengths (n, orders), of
    precisions root' root: its least place, half its second derivative, its least value, and the logarithm of the
    determinant of the covariance over the signal's, by the Cholesky factor of 1 + root covariance root'."""
    n, (radii, diameters, loads, orders) = len(located), strengths.shape
    best, curvature = np.empty((n, diameters, loads - 1)), np.empty((n, diameters, loads - 1))
    cost, size = np.empty((n, diameters, loads - 1)), np.zeros((n, diameters, loads - 1))
    half, factor = np.empty((orders, orders)), np.empty((orders, orders))
    miss, step, seen = np.empty(orders), np.empty(orders), np.empty((2, orders))
    for i in range(n):
        for d in range(diameters):
            for k in range(loads - 1):
                for p in range(orders):
                    miss[p], step[p] = -located[i, p], 0.0
                    for r in range(radii):
                        here = strengths[r, d, k, p]
                        miss[p] += radial[i, r] * here
                        step[p] += radial[i, r] * (strengths[r, d, k + 1, p] - here)
                for p in range(orders):
                    seen[0, p], seen[1, p] = 0.0, 0.0
                    for q in range(orders):
                        seen[0, p] += root[i, p, q] * miss[q]
                        seen[1, p] += root[i, p, q] * step[q]
                        half[p, q] = 0.0
                        for r in range(orders):
                            half[p, q] += root[i, p, r] * covariance[nearest[i], d, k, r, q]
                for p in range(orders):
                    for q in range(p + 1):
                        whole = 1.0 if p == q else 0.0
                        for r in range(orders):
                            whole += half[p, r] * root[i, q, r]
                        for r in range(q):
                            whole -= factor[p, r] * factor[q, r]
                        factor[p, q] = math.sqrt(whole) if p == q else whole / factor[q, q]
                    size[i, d, k] += 2 * math.log(factor[p, p])
                    for j in range(2):
                        for r in range(p):
                            seen[j, p] -= factor[p, r] * seen[j, r]
                        seen[j, p] /= factor[p, p]
                square, across, bent = 0.0, 0.0, 0.0
                for p in range(orders):
                    square += seen[0, p] ** 2
                    across += seen[0, p] * seen[1, p]
                    bent += seen[1, p] ** 2
                bent = max(bent, 1e-300)
                best[i, d, k], curvature[i, d, k], cost[i, d, k] = -across / bent, bent, square - across**2 / bent
    return best, curvature, cost, size


def _likely(nearest: Array, cost: Array, added: Array, best: Array, width: Array, least: Array) -> Array:
    """(2, n, D, G - 1) places between which punches are within the profile likelihood's interval of COVERAGE: the cost,
    what is `added` to it with it, exceeds the `least` one (n,) by at most that of a normal variable (Pawitan, In All
    Likelihood, 2001, sections 2.6 and 3.4)."""
    most = least[:, None, None] + normal(COVERAGE) ** 2
    half = width * np.sqrt(np.maximum(most - cost - added, 0.0))
    return np.where(nearest + added <= most, np.clip([best - half, best + half], 0.0, 1.0), np.nan)


def _square(table: Table, place_mm: Array) -> Array:
    """(n,) squares of the radii of places (n, 2) over that of the interior, at most 1."""
    return np.minimum((radial(table.ring, place_mm) / table.interior) ** 2, 1.0)


def _radial(table: Table, place_mm: Array) -> Array:
    """(n, RADII) weights of Lagrange's parabola through the table's radii at places (n, 2)."""
    square = _square(table, place_mm)
    return np.stack([np.prod([(square - b) / (a - b) for b in RADII if b != a], axis=0) for a in RADII], axis=1)


def _log_mass(lower: Array, upper: Array) -> Array:
    """log of the normal probability between two bounds, lower < upper, safe in both tails."""
    flip = lower > 0
    lower, upper = np.where(flip, -upper, lower), np.where(flip, -lower, upper)
    larger, smaller = log_ndtr(upper), log_ndtr(lower)
    return larger + np.log1p(-np.exp(np.minimum(smaller - larger, -1e-300)))


def _truncated(best: Array, width: Array, log_mass: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of normal variables of these means and widths, truncated to [0, 1] (Johnson, Kotz,
    Balakrishnan, Continuous Univariate Distributions 1, 1994, section 13.10.1)."""
    lower, upper = -best / width, (1 - best) / width
    at_lower, at_upper = (np.exp(np.minimum(-0.5 * z**2 - 0.5 * np.log(2 * np.pi) - log_mass, 300.0))
                          for z in (lower, upper))
    shift = at_lower - at_upper
    variance = 1 + lower * at_lower - upper * at_upper - shift**2
    return np.clip(best + width * shift, 0.0, 1.0), np.sqrt(np.clip(width**2 * variance, 0.0, 1 / 12))


def drawn(found: Posterior, values: Array) -> Array:
    """(n, DRAWS, k) values (RADII or 1, D, G, k) of the table's nodes at the punches that stand for each posterior."""
    which, place = found.draws
    weights = found.radial if len(values) > 1 else np.ones((len(which), 1))
    loads = values.shape[2]
    node = which + which // (loads - 1)  # a diameter has one node more than intervals
    out = np.zeros((*which.shape, values.shape[-1]))
    for of_radius, nodes in zip(weights.T, values.reshape(len(values), -1, values.shape[-1]), strict=True):
        start = nodes[node]
        out += of_radius[:, None, None] * (start + (nodes[node + 1] - start) * place[..., None])
    return out


def moments(values: Array) -> tuple[Array, Array]:
    """Mean (n, k) and covariance (n, k, k) of drawn values (n, DRAWS, k)."""
    mean = values.mean(axis=1)
    off = values - mean[:, None]
    return mean, off.transpose(0, 2, 1) @ off / values.shape[1]


def one_sided(found: Posterior, values: Array, mean: Array) -> Array:
    """(2, n, k) distances, down and up, of means (n, k) to the ends of values (RADII or 1, D, G, k) of the table's
    nodes over the likely punches, in those of the normal variable; 0 where a mean lies outside."""
    at_node = np.tensordot(found.radial, values, 1) if len(values) > 1 else values
    reached = at_node[:, :, :-1] + np.diff(at_node, axis=2) * found.likely[..., None]
    reached = np.where(np.isnan(reached), mean[:, None, None], reached)
    return np.maximum([mean - reached.min(axis=(0, 2, 3)), reached.max(axis=(0, 2, 3)) - mean], 0.0) / normal(COVERAGE)


def resolved(found: Posterior) -> Mask:
    """(n,) whether a punch of the table made the strengths, and its diameters are known, one, or nearer than the
    posterior is wide."""
    d, fits = found.table.d_mm, found.cost < FITS
    if found.table.known or len(d) == 1:
        return fits
    by_d = np.exp(found.log_weight).sum(axis=2)
    return fits & (np.sqrt(np.maximum(by_d @ d**2 - (by_d @ d) ** 2, 0.0)) > RESOLVED * (d[1] - d[0]))


def starts(found: Posterior, bands: int) -> Array:
    """(n, bands, 2) most probable (d, g) in each of some bands of loads, which part the branches of one signal; of all
    bands in place of those ruled out where a punch of the table made the strengths."""
    n, groups = len(found.log_weight), np.array_split(np.arange(LOADS - 1), bands)
    load = found.table.load[:, :-1] + found.along * np.diff(found.table.load, axis=1)
    out, log_weight = np.empty((n, bands, 2)), np.empty((n, bands))
    for k, group in enumerate(groups):
        each = found.log_weight[:, :, group].reshape(n, -1)
        best, log_weight[:, k] = np.argmax(each, axis=1), each.max(axis=1)
        out[:, k, 0] = found.table.d_mm[best // len(group)]
        out[:, k, 1] = load[:, :, group].reshape(n, -1)[np.arange(n), best]
    ruled_out = (found.cost[:, None] < FITS) & (log_weight < log_weight.max(axis=1, keepdims=True) - RULED_OUT)
    return np.where(ruled_out[..., None], out[np.arange(n), log_weight.argmax(axis=1)][:, None], out)
