"""Sweeps of several temperatures shifted along the frequency into one curve, and the law of their shifts.

Neighbouring sweeps are moved onto each other: the logarithms of both storage moduli follow one polynomial of log f,
whose degree the BIC chooses, and the shift has the least misfit, large misfits counting less (Huber). The loss moduli
say the same on their own; where both agree within their errors they count together, else the storage modulus does.
Moduli are not moved along their own axis.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from matcal.laws.histories.time_temperature import GAS_J_PER_MOL_K, Arrhenius, Shift, Wlf, decades
from matcal.reduction.experiment import Sweep
from touchcal.arrays import Array

_DEGREES = (1, 2, 3, 4)
# standard deviations from which on a misfit counts less; turns of weights; share of misfit below which none is seen
_HUBER, _TURNS, _FINEST = 1.5, 10, 1e-4
# decades past the length of a sweep, and above no shift at all, that a shift is searched over; steps in each decade
_FAR, _BACK, _STEPS = 1.0, 0.3, 10
_AGREE = 3.0  # standard errors within which storage and loss modulus agree
_USUAL_K = 20.0 + 273.15  # reference that is taken where none is given
_MOST_C, _MOST_K = 2000.0, 5000.0  # largest C_1 and C_2 that are searched


@dataclass(frozen=True)
class ShiftFit:
    """Shifts of sweeps to the reference, and the law through them."""

    temperature_K: Array  # (m,) of the sweeps, increasing
    log10_a: Array  # (m,) decades, 0 at the reference
    sd: Array  # (m,) their standard deviations
    law: Shift
    law_sd: Array  # standard deviations of the law's numbers, the reference left out
    misfit_decades: float  # rms of shifts about the law
    gaps: tuple[float, ...]  # temperatures, K, whose sweep overlaps with none below it
    disagree: tuple[float, ...]  # temperatures, K, at which storage and loss modulus shift differently
    moves: Array  # (m, m - 1) decades by which a standard deviation of each shift between neighbours moves each sweep


@dataclass(frozen=True)
class _Pair:
    decades: float
    variance: float
    gap: bool
    agree: bool


def shifted(storage_Pa: Array, sweep: Sweep, reference_K: float | None) -> ShiftFit:
    """The shifts of sweeps at two temperatures or more, to the sweep nearest `reference_K` (20 C where none is given).
    """
    temperature = sweep.temperature_K
    parts = [sweep.group == k for k in range(temperature.size)]
    log_f, curves = np.log10(sweep.frequency_Hz), (np.log(storage_Pa), np.log(sweep.loss_Pa))
    pairs = [_pair([log_f[a], log_f[b]], [[y[a], y[b]] for y in curves])
             for a, b in pairwise(parts)]
    at = int(np.argmin(np.abs(temperature - (_USUAL_K if reference_K is None else reference_K))))
    path = np.tril(np.ones((temperature.size, len(pairs))), -1)
    path = path - path[at]
    log10_a = path @ np.array([p.decades for p in pairs])
    moves = path * np.sqrt([p.variance for p in pairs])
    covariance = path @ np.diag([p.variance for p in pairs]) @ path.T
    law, law_sd, misfit = _law(temperature, log10_a, covariance, at)
    return ShiftFit(temperature, log10_a, np.sqrt(np.diag(covariance)), law, law_sd, misfit,
                    tuple(float(t) for t, p in zip(temperature[1:], pairs, strict=True) if p.gap),
                    tuple(float(t) for t, p in zip(temperature[1:], pairs, strict=True) if not p.agree), moves)


def _pair(log_f: Sequence[Array], curves: Sequence[Sequence[Array]]) -> _Pair:
    """How far the second sweep is moved to lie on the first."""
    stored, loss = curves
    grid = np.arange(-(max(float(np.ptp(x)) for x in log_f) + _FAR), _BACK, 1 / _STEPS)
    by, variance = _best(log_f, stored, grid, None)
    other, its = _best(log_f, loss, grid, by)
    agree = abs(other - by) < _AGREE * np.sqrt(variance + its)
    if agree:
        by, variance = (by * its + other * variance) / (its + variance), its * variance / (its + variance)
    gap = max(float(log_f[0].min() - (log_f[1].max() + by)), float(log_f[1].min() + by - log_f[0].max()), 0.0)
    return _Pair(by, variance + gap**2, gap > 0, bool(agree))


def _left(log_f: Sequence[Array], y: Sequence[Array], by: float, degree: int, weight: Array) -> Array:
    """What a polynomial through both sweeps leaves of them."""
    x = np.r_[log_f[0], log_f[1] + by]
    basis = np.polynomial.chebyshev.chebvander(2 * (x - x.min()) / max(float(np.ptp(x)), 1e-9) - 1, degree)
    both, root = np.concatenate(y), np.sqrt(weight)
    return np.asarray(both - basis @ np.linalg.lstsq(root[:, None] * basis, root * both, rcond=None)[0])


def _best(log_f: Sequence[Array], y: Sequence[Array], grid: Array, start: float | None) -> tuple[float, float]:
    """Shift of least weighted misfit near `start`, or on the grid, and its variance, by the polynomial of least BIC."""
    count = sum(map(len, y))
    tried = [_by_degree(log_f, y, grid, degree, start) for degree in _DEGREES if count - degree - 2 >= 3]
    return min(tried, key=lambda row: row[0])[1:]


def _by_degree(log_f: Sequence[Array], y: Sequence[Array], grid: Array, degree: int,
               start: float | None) -> tuple[float, float, float]:
    """(BIC, shift, variance) with weights by the size of what is left; every shift of the grid that fits as well is
    within two standard deviations."""
    count = sum(map(len, y))
    weight = np.ones(count)

    def profile() -> Array:
        return np.array([weight @ _left(log_f, y, d, degree, weight) ** 2 for d in grid])

    by = float(grid[int(np.argmin(profile()))]) if start is None else start
    for _ in range(_TURNS):
        left = _left(log_f, y, by, degree, weight)
        scale = max(1.4826 * float(np.median(np.abs(left))), _FINEST)
        weight = 1 / np.maximum(1.0, np.abs(left) / (_HUBER * scale))
        slope = np.sqrt(weight) * (_left(log_f, y, by + 1e-4, degree, weight)
                                   - _left(log_f, y, by - 1e-4, degree, weight)) / 2e-4
        curve = float(slope @ slope)
        by -= float(np.clip(slope @ (np.sqrt(weight) * left) / max(curve, 1e-300), -0.3, 0.3))
    square = float(weight @ _left(log_f, y, by, degree, weight) ** 2)
    free = count - degree - 2
    near = grid[profile() < max(square, count * _FINEST**2) * (1 + 4 / free)]
    width = 0.25 * (max(near.max(), by) - min(near.min(), by)) if near.size else 0.0
    variance = max(max(square / free, _FINEST**2) / max(curve, 1e-300), width**2)
    return count * np.log(max(square / count, _FINEST**2)) + (degree + 2) * np.log(count), by, variance


def _law(temperature_K: Array, log10_a: Array, covariance: Array, at: int) -> tuple[Shift, Array, float]:
    """WLF or Arrhenius, whichever has the lower BIC, the standard deviations of its numbers, and the rms misfit. Where
    neither follows the shifts within their errors, what it misses counts as an error of each shift by itself."""
    rest = np.arange(temperature_K.size) != at
    t, y, spread = temperature_K[rest], log10_a[rest], covariance[np.ix_(rest, rest)]
    found = _fitted(t, y, spread, float(temperature_K[at]), temperature_K)
    for _ in range(_TURNS if found.square > max(t.size - found.numbers, 1) else 0):
        found = _fitted(t, y, spread + found.misfit**2 * np.eye(t.size), float(temperature_K[at]), temperature_K)
    return found.law, found.sd, found.misfit


@dataclass(frozen=True)
class _FittedLaw:
    law: Shift
    sd: Array
    square: float  # weighted
    misfit: float  # rms, decades

    @property
    def numbers(self) -> int:
        return self.sd.size


def _fitted(t: Array, y: Array, covariance: Array, reference: float, every: Array) -> _FittedLaw:
    """The better of both laws for shifts y (k,) at temperatures t (k,), K, with this covariance."""
    root = np.linalg.inv(np.linalg.cholesky(covariance))

    def search(make: Callable[[Array], Shift], start: Array, low: Array, high: Array, unit: float) -> _FittedLaw:
        found = least_squares(lambda p: root @ (decades(make(p), t) - y), np.clip(start, low, high),
                              bounds=(low, high), x_scale=np.abs(start) + 1.0)
        law = make(found.x)
        return _FittedLaw(law, unit * np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac))), 2 * found.cost,
                          float(np.sqrt(np.mean((decades(law, t) - y) ** 2))))

    slope = float((t - reference) @ y / ((t - reference) @ (t - reference)))
    energy = -slope * GAS_J_PER_MOL_K * np.log(10) * reference**2 / 1e3
    tried = [search(lambda p: Arrhenius(1e3 * float(p[0]), reference), np.array([energy]), np.array([-1e4]),
                    np.array([1e4]), 1e3)]
    if t.size > 2:
        least = max(reference - float(every.min()), 0.0) + 1.0
        tried += [search(lambda p: Wlf(float(p[0]), float(p[1]), reference), np.array([-slope * c, c]),
                         np.array([0.0, least]), np.array([_MOST_C, _MOST_K]), 1.0)
                  for c in (least + 10.0, least + 50.0, least + 200.0)]
    return min(tried, key=lambda row: row.square + row.numbers * np.log(max(t.size, 2)))
