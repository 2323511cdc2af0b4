"""Conformal intervals: how far families disagree and templates spread says which frames are surer, held-out errors say
how many of these spreads hold 90 %. Errors along x and y calibrate one factor, each counted as one.

The order statistic of few errors is a noisy one, and their mean a steadier: the logarithm of the factor is a mean of
both, in which the steadier counts as PRIOR_PRESSES presses.

The 90 % ellipse of x and y with half widths h and correlation r is u^2 - 2 r u v + v^2 <= (1 - r^2) e^2, where u and v
are the errors over h: its box is e times that of the intervals.
"""

from dataclasses import dataclass, replace

import numpy as np

from surrogate.recordings.blocks import FEW
from surrogate.statistics.conformal import conformal_scale
from touchcal.arrays import Array, Mask

# Spread of a frame without any, tried, over the root mean square of held-out errors; of fewer than FEW presses the
# greatest is taken, for the least width of several is too small where errors are few.
FLOORS = (0.3, 1.0, 3.0)
PRIOR_PRESSES = 40.0
# Mean absolute errors that hold 90 %: 2.06 of a normal variable, 2.13 of t with three to five degrees of freedom, 2.30
# of a Laplace variable. And e of t with five degrees; 1.30 of a normal variable.
MEAN_ERRORS, ELLIPSE = 2.2, 1.36
MOST_CORRELATED = 0.95


@dataclass(frozen=True, eq=False)
class Bounds:
    """90 % intervals of some frames, and their ellipses."""

    half_width: Array  # (n, k) of the intervals
    correlation: Array  # (n,) of x and y; 0 of one label
    ellipse: Array  # (n,) e; 1 of one label


@dataclass(frozen=True, eq=False)
class Intervals:
    """Half widths factor sqrt(spread^2 + floor^2)."""

    floor: float  # in the unit of the label
    factor: float
    correlation: float  # of x and y, of held-out errors, less what spreads say of it; 0 of one label
    ellipse: float  # e; 1 of one label

    def half_width(self, spread: Array) -> Array:
        """(n, k) half width of the 90 % interval of spreads (n, k)."""
        return self.factor * np.sqrt(spread**2 + self.floor**2)

    def bounds(self, spread: Array, cross: Array) -> Bounds:
        """Intervals and ellipses of spreads (n, k) whose x and y have covariance (n,), in the unit squared."""
        sd = np.sqrt(spread**2 + self.floor**2)
        correlation = self.correlation + cross / (sd[:, 0] * sd[:, -1])
        return Bounds(self.half_width(spread), np.clip(correlation, -MOST_CORRELATED, MOST_CORRELATED),
                      np.full(len(spread), self.ellipse))


def calibrated(error: Array, spread: Array, cross: Array, presses: int | None = None) -> Intervals:
    """Intervals that hold 90 % of held-out errors (n, k) of these spreads (n, k), and ellipses likewise: of the floors
    tried, the one of least mean width. cross: (n,) covariance of x and y; presses: that
    the errors are of, each of its own where that is None."""
    count, labels = len(error) if presses is None else presses, error.shape[1]
    rms = max(float(np.sqrt(np.mean(error**2))), float(np.finfo(float).tiny))
    tried = []
    for floor in (share * rms for share in (FLOORS if count >= FEW else FLOORS[-1:])):
        sd = np.sqrt(spread**2 + floor**2)
        order = float(conformal_scale(error.reshape(-1, 1), sd.reshape(-1, 1), count * labels)[0])
        factor = _steadied(order, MEAN_ERRORS * float(np.mean(np.abs(error) / sd)), count)
        tried.append((float(np.mean(factor * sd)), floor, factor))
    _, floor, factor = min(tried)
    if labels == 1:
        return Intervals(floor, factor, 0.0, 1.0)
    sd = np.sqrt(spread**2 + floor**2)
    (u, v), said = (error / sd).T, cross / sd.prod(axis=1)
    found = u @ v / max(np.sqrt((u @ u) * (v @ v)), np.finfo(float).tiny) - said.mean()
    correlation = float(found) * count / (count + FEW)
    bounds = Intervals(floor, factor, correlation, 1.0).bounds(spread, cross)
    order = float(conformal_scale(radius(error, bounds)[:, None], np.ones((len(error), 1)), count)[0])
    return Intervals(floor, factor, correlation, _steadied(order, ELLIPSE, count))


def radius(error: Array, bounds: Bounds) -> Array:
    """(n,) the e of the ellipse through each error (n, 2) of x and y."""
    (u, v), r = (error / bounds.half_width).T, bounds.correlation
    return np.sqrt(np.maximum(u**2 - 2 * r * u * v + v**2, 0) / (1 - r**2))


def widened(bounds: Bounds, factor: Array) -> Bounds:
    """Bounds so many times (n,) as wide."""
    return replace(bounds, half_width=bounds.half_width * factor[:, None])


def chosen(rows: Mask, one: Bounds, other: Bounds) -> Bounds:
    """The first bounds on some rows, the second on the rest."""
    return Bounds(np.where(rows[:, None], one.half_width, other.half_width),
                  np.where(rows, one.correlation, other.correlation), np.where(rows, one.ellipse, other.ellipse))


def _steadied(order: float, steady: float, presses: int) -> float:
    weight = presses / (presses + PRIOR_PRESSES)
    tiny = np.finfo(float).tiny
    return float(np.exp(weight * np.log(max(order, tiny)) + (1 - weight) * np.log(max(steady, tiny))))
