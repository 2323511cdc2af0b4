"""Kernel ridge regression from signals to places, every setting by leaving a press out: the yardstick of the other
families.

y(s) = mean + sum_i a_i exp(-|f(s) - f(s_i)|^2 / (c h)), h the median squared distance of the training features,
or their mean where that is 0.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from surrogate.recordings.patterns import compressed, compression_scale, direction
from surrogate.statistics import left_out
from surrogate.statistics.gaussian_process import spread_evenly, squared_distance
from touchcal.arrays import Array, Index, Mask

VIEWS = ("plain", "direction", "compressed")
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)  # c
RIDGES = (1e-4, 1e-3, 1e-2, 1e-1)  # added to the diagonal of the kernel
MOST_SEARCHED = 600  # rows that settings are chosen on
ROUNDING = 1e-9  # part of its norm by which a signal computed again may differ
OF_NOISE = 0.2  # part of the noise by which one that was written again may


@dataclass(frozen=True, eq=False)
class KernelRidge:
    """A fitted regression."""

    view: str  # one of VIEWS
    scale: float  # of the compressed view
    width: float  # c h
    ridge: float
    nodes: Array  # (n, m) training features
    weights: Array  # (n, k) a_i
    mean: Array  # (k,)

    def read(self, signal: Array) -> Array:
        """(n, k) targets of signals (n, m)."""
        apart = squared_distance(_view(self.view, self.scale, signal), self.nodes)
        return self.mean + np.exp(-apart / self.width) @ self.weights

    def nearest(self, signal: Array) -> Array:
        """(n, 1) squared distance of signals (n, m) from the nearest training signal, in the view that is read."""
        return squared_distance(_view(self.view, self.scale, signal), self.nodes).min(axis=1, keepdims=True)

    def trained_on(self, signal: Array, other: Array) -> Mask:
        """(n,) whether signals (n, m) are training signals, written with fewer digits perhaps: they are nearer to one
        than a part of how far `other` is from them, the same signals with the noise of two frames."""
        seen, moved = (_view(self.view, self.scale, one) for one in (signal, other))
        nearest = self.nodes[squared_distance(seen, self.nodes).argmin(axis=1)]
        least = np.maximum(ROUNDING * np.linalg.norm(nearest, axis=1), OF_NOISE * np.linalg.norm(moved - seen, axis=1))
        return np.linalg.norm(seen - nearest, axis=1) <= least


def fit(signal: Array, target: Array, press: Index | None = None) -> KernelRidge:
    """Fit targets (n, k) on signals (n, m) of presses (n,), each row its own where these are None: the view, the width
    and the ridge of least distance over at most MOST_SEARCHED rows, evenly spread, each read without its press."""
    scale, searched = compression_scale(signal), spread_evenly(len(signal), MOST_SEARCHED)
    scored = [(score, view, width, ridge) for view in VIEWS
              for score, width, ridge in _leave_one_out(_view(view, scale, signal[searched]), target[searched],
                                                            None if press is None else press[searched])]
    _, view, width, ridge = min(scored)
    return _solved(view, scale, width, ridge, signal, target)


def held_out(fitted: KernelRidge, signal: Array, target: Array, blocks: Index, seen: Array | None = None) -> Array:
    """(n, k) targets of the training signals, or of the same presses as seen in other signals (n, m), each read without
    the rows of its block, settings as fitted."""
    seen = signal if seen is None else seen
    out = np.empty_like(target)
    for block in np.unique(blocks):
        kept = blocks != block
        part = _solved(fitted.view, fitted.scale, fitted.width, fitted.ridge, signal[kept], target[kept])
        out[~kept] = part.read(seen[~kept])
    return out


def nearest_held_out(fitted: KernelRidge, blocks: Index) -> Array:
    """(n, 1) squared distance of each training signal from the nearest one outside its block."""
    out = np.empty((len(blocks), 1))
    for block in np.unique(blocks):
        gone = blocks == block
        out[gone, 0] = squared_distance(fitted.nodes[gone], fitted.nodes[~gone]).min(axis=1)
    return out


def _leave_one_out(nodes: Array, target: Array, press: Index | None) -> list[tuple[float, float, float]]:
    """Mean distance of rows read without their press, width and ridge of each setting."""
    apart, left = squared_distance(nodes, nodes), target - target.mean(axis=0)
    typical = float(np.median(apart)) or float(apart.mean()) or 1.0
    out = []
    for c in WIDTHS:
        values, axes = np.linalg.eigh(np.exp(-apart / (c * typical)))
        for ridge in RIDGES:
            inverse = 1 / (np.maximum(values, 0) + ridge)
            missed, _ = left_out.missed(left_out.of_axes(axes, inverse), axes @ (inverse[:, None] * (axes.T @ left)),
                                        press)
            out.append((float(np.linalg.norm(missed, axis=1).mean()), c * typical, ridge))
    return out


def _solved(view: str, scale: float, width: float, ridge: float, signal: Array, target: Array) -> KernelRidge:
    nodes, mean = _view(view, scale, signal), target.mean(axis=0)
    factor = cho_factor(np.exp(-squared_distance(nodes, nodes) / width) + ridge * np.eye(len(nodes)))
    return KernelRidge(view, scale, width, ridge, nodes, cho_solve(factor, target - mean), mean)


def _view(view: str, scale: float, signal: Array) -> Array:
    if view == "plain":
        return signal
    return direction(signal) if view == "direction" else compressed(signal, scale)
