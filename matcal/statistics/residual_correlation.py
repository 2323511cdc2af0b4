"""How correlated the residuals of a fit are, judged by what the fit has left of them.

A flexible law absorbs slow errors, so its residuals look less correlated than the errors were. Restricted maximum
likelihood undoes that: errors of each curve are sigma^2 [(1 - w) rho^|i - j| + w delta_ij], slow ones with a length
-1/ln rho next to white ones, and the likelihood is that of the part of the data which no parameter can follow. It is
averaged over a grid of lengths, shares and sizes, because few residuals do not pin them down; before looking, errors
are as likely white as correlated.

Source: Patterson & Thompson, Biometrika 58 (1971) 545, DOI 10.1093/biomet/58.3.545.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, toeplitz

from touchcal.arrays import Array

# points of a curve, or means of neighbouring ones where it has more; lengths, shares of white noise and sizes tried
_MOST, _LENGTHS, _WHITE, _SIZES = 200, 8, (0.0, 0.03, 0.15, 0.5), np.exp(np.linspace(-1.5, 2.5, 25))


@dataclass(frozen=True)
class Errors:
    """Covariance of the errors of one curve, in blocks of neighbouring points."""

    covariance: Array  # (m, m) covariance of the means over the blocks
    first: NDArray[np.int64]  # (m,) first point of each block
    effective_sample_size: float  # independent errors of the same size that would be worth as much
    count: int  # points of the curve

    def of(self, gain: Array) -> Array:
        """(K, K) covariance of gain @ errors for gain (K, n)."""
        summed = np.add.reduceat(gain, self.first, axis=1)
        return summed @ self.covariance @ summed.T


@dataclass(frozen=True)
class _Sums:
    """What one correlation of one curve makes of slopes X and residual r at unit variance."""

    normal: Array   # (K, K) X' R^-1 X
    right: Array    # (K,) X' R^-1 r
    square: float   # r' R^-1 r
    log_det: float  # ln |R|
    count: int      # residuals


def correlated_errors(residuals: Sequence[Array], slopes: Sequence[Array], prior: Array,
                      least: Sequence[float]) -> tuple[Errors, ...]:
    """Errors of each curve from its residual (n_k,), the slopes (n_k, K) of everything that was fitted, the precision
    (K, K) of its prior in units of the residual's variance, and the least standard deviation that its noise has."""
    blocks = [_blocks(r, x) for r, x in zip(residuals, slopes, strict=True)]
    grids = [_grid(r.size) for r, _, _ in blocks]
    sums = [[_sums(root, r, x) for root in _roots(r.size)] for r, x, _ in blocks]
    unit = [float(np.mean(r**2)) or 1e-300 for r, _, _ in blocks]
    chosen = [_scaled(s[0], u) for s, u in zip(sums, unit, strict=True)]
    share: list[Array] = []
    for _ in range(2):
        share = []
        for k, (own, u) in enumerate(zip(sums, unit, strict=True)):
            weight = _weights(own, u, [*chosen[:k], *chosen[k + 1:]], prior)
            share.append(weight)
            best = np.unravel_index(int(np.argmax(weight)), weight.shape)
            chosen[k] = _scaled(own[int(best[0])], u * float(_SIZES[int(best[1])]))
    return tuple(_average(grid, weight, u, first, low, residual.size) for grid, weight, u, (_, _, first), low, residual
                 in zip(grids, share, unit, blocks, least, residuals, strict=True))


def propagated(errors: Sequence[Errors], gain: Array) -> Array:
    """(K, K) covariance of gain @ errors for gain (K, n) over the points of all curves."""
    ends = np.cumsum([e.count for e in errors])[:-1]
    return np.sum([e.of(g) for e, g in zip(errors, np.split(gain, ends, axis=1), strict=True)], axis=0)


def _blocks(residual: Array, slopes: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    first = np.unique(np.linspace(0, residual.size, min(residual.size, _MOST) + 1).astype(int)[:-1])
    count = np.diff(first, append=residual.size)
    return np.add.reduceat(residual, first) / count, np.add.reduceat(slopes, first, axis=0) / count[:, None], first


# Sizes of curves whose matrices are kept: of one fit's curves, which several laws follow in turn; 20 MB each at most.
_KEPT = 4


@functools.lru_cache(_KEPT)
def _grid(n: int) -> Array:
    """Correlation matrices (grid, n, n): white, then slow ones of several lengths with some white noise added."""
    lags, out = np.arange(n), [np.eye(n)]
    for length in np.geomspace(0.7, max(n / 4, 1.0), _LENGTHS):
        slow = toeplitz(np.exp(-lags / length))
        out += [(1 - white) * slow + white * np.eye(n) for white in _WHITE]
    return np.stack(out)


@functools.lru_cache(_KEPT)
def _roots(n: int) -> Array:
    """Lower Cholesky factors (grid, n, n) of those matrices."""
    return np.asarray(np.linalg.cholesky(_grid(n) + 1e-10 * np.eye(n)), dtype=float)


def _sums(root: Array, residual: Array, slopes: Array) -> _Sums:
    solved = cho_solve((root, True), np.column_stack([slopes, residual]))
    return _Sums(slopes.T @ solved[:, :-1], slopes.T @ solved[:, -1], float(residual @ solved[:, -1]),
                 2 * float(np.log(np.diag(root)).sum()), residual.size)


def _scaled(sums: _Sums, variance: float) -> _Sums:
    """The sums over slopes at another variance; another curve's probabilities ask for no more."""
    return replace(sums, normal=sums.normal / variance, right=sums.right / variance)


def _weights(own: Sequence[_Sums], unit: float, others: Sequence[_Sums], prior: Array) -> Array:
    """(grid, sizes) probabilities of one curve's correlation and variance, the other curves as they are."""
    normal = np.sum([o.normal for o in others], axis=0) if others else np.zeros_like(prior)
    right = np.sum([o.right for o in others], axis=0) if others else np.zeros(prior.shape[0])
    variance = unit * _SIZES
    a = np.stack([s.normal for s in own])[:, None] / variance[:, None, None] + normal + prior
    b = np.stack([s.right for s in own])[:, None] / variance[:, None] + right
    scale = np.sqrt(np.einsum("gskk->gsk", a))
    root = np.linalg.cholesky(a / (scale[..., None] * scale[..., None, :]) + 1e-12 * np.eye(prior.shape[0]))
    bent = np.linalg.solve(root, (b / scale)[..., None])[..., 0]
    log_normal = 2 * (np.log(np.einsum("gskk->gsk", root)) + np.log(scale)).sum(axis=-1)
    square = np.array([s.square for s in own])[:, None] / variance - np.sum(bent**2, axis=-1)
    size = np.array([s.log_det for s in own])[:, None] + own[0].count * np.log(variance)
    log = -0.5 * (size + log_normal + square)
    log[1:] -= np.log(len(own) - 1)
    weight = np.exp(log - log.max())
    return weight / weight.sum()


def _average(grid: Array, weight: Array, unit: float, first: NDArray[np.int64], least: float,
             n: int) -> Errors:
    """Covariance averaged over correlations and sizes, scaled up to the noise that is known to be there."""
    per_shape = weight @ (unit * _SIZES)
    covariance = np.tensordot(per_shape, grid, axes=1)
    size = float(covariance[0, 0])
    covariance = covariance * max(1.0, least**2 * first.size / n / size)
    effective = first.size**2 * float(covariance[0, 0]) / float(covariance.sum())
    return Errors(covariance, first, effective, n)


def integrated_autocorrelation_time(residual: Array) -> float:
    """Integrated autocorrelation time 1 + 2 sum rho_k of residuals (n,) with known mean 0, at least 1. The sum runs to
    the first window of five times itself (Sokal); n over it is the effective sample size."""
    n = residual.size
    power = np.abs(np.fft.rfft(residual, 2 * n)) ** 2
    rho = np.fft.irfft(power)[:n]
    if rho[0] == 0:
        return 1.0
    total = 2 * np.cumsum(rho / rho[0]) - 1
    window = np.flatnonzero(np.arange(n) >= 5 * total)
    return float(max(1.0, total[window[0]] if window.size else total.max()))
