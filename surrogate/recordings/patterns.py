"""Two views of a signal: its direction, free of how deep a press is, and its readings compressed, which keep their
size."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array

# Median size of a reading below which a compressed reading is in proportion to the signal.
LINEAR = 3.0


def direction(signal: Array) -> Array:
    """(n, m) signals over their norm; zeros of a signal of zeros."""
    return signal / np.maximum(np.linalg.norm(signal, axis=1, keepdims=True), np.finfo(float).tiny)


def centred(rows: Array) -> Array:
    """Rows (n, m) less their mean."""
    return rows - rows.mean(axis=0)


def compressed(signal: Array, scale: float) -> Array:
    """(n, m) arsinh of the signals over a scale in the unit of the signal."""
    return np.arcsinh(signal / scale)


def compression_scale(signal: Array) -> float:
    """The scale of `compressed`: LINEAR times the median size of a reading."""
    return LINEAR * max(float(np.median(np.abs(signal))), np.finfo(float).tiny)


@dataclass(frozen=True)
class View:
    """How a signal is seen: its readings compressed, or those of its direction."""

    directed: bool
    scale: float  # of `compressed`

    def of(self, signal: Array) -> Array:
        """(n, m) patterns of signals (n, m)."""
        return compressed(direction(signal) if self.directed else signal, self.scale)


def view_of(signal: Array, readings: bool) -> View:
    """The view of readings, or of directions, whose scale signals (n, m) give."""
    return View(not readings, compression_scale(signal if readings else direction(signal)))


@dataclass(frozen=True, eq=False)
class Features:
    """Both views of a signal, each entry standardised over the training rows."""

    scale: float  # of `compressed`
    mean: Array  # (2 m,)
    spread: Array  # (2 m,)

    def of(self, signal: Array) -> Array:
        """(n, 2 m) features of signals (n, m)."""
        return (_views(signal, self.scale) - self.mean) / self.spread


def learn_features(signal: Array) -> Features:
    """Scale, means and spreads of the features of signals (n, m)."""
    scale = compression_scale(signal)
    views = _views(signal, scale)
    spread = views.std(axis=0)
    return Features(scale, views.mean(axis=0), np.where(spread > 0, spread, 1.0))


def _views(signal: Array, scale: float) -> Array:
    return np.concatenate([compressed(signal, scale), direction(signal)], axis=1)
