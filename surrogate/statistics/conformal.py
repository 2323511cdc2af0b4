"""Split-conformal intervals: how many standard deviations hold so many of the errors of rows that did not train (Lei et
al. 2018).

Of presses, which are few, one factor calibrates the errors along x and y, each counted as one, and spreads have a
floor: the order statistic of few errors is a noisy one, and their mean a steadier, so that the logarithm of the factor
is a mean of both, in which the steadier counts as PRIOR_PRESSES presses. What few errors leave open of their own size
makes it as much wider as Student's t is than the normal distribution.

The 90 % ellipse of x and y with half widths h and correlation r is u^2 - 2 r u v + v^2 <= (1 - r^2) e^2, where u and v
are the errors over h: its box is e times that of the intervals.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.special import betaincinv, ndtri, stdtrit

from touchcal.arrays import Array, Mask

COVERAGE = 0.90
# Part of the calibrating rows, those of largest standard deviations, that has a factor of its own where it is enough.
UNSURE = 1 / 3
# Chance that the calibration rows drawn leave a lower coverage than is said, and the least that is not cautioned.
UNLUCKY, LEAST = 0.05, 0.85
FEW = 50  # presses from which on several floors are tried
# Spread of a frame without any, tried, over the root mean square of held-out errors; of fewer than FEW presses the
# greatest is taken, for the least width of several is too small where errors are few.
FLOORS = (0.3, 1.0, 3.0)
PRIOR_PRESSES = 40.0
# Mean absolute errors that hold 90 %: 2.06 of a normal variable, 2.13 of t with three to five degrees of freedom, 2.30
# of a Laplace variable. And e of t with five degrees; 1.30 of a normal variable.
MEAN_ERRORS, ELLIPSE = 2.2, 1.36
MOST_CORRELATED = 0.95


def normal(coverage: float) -> float:
    """Standard deviations about the mean that hold this part of a normal variable."""
    return float(ndtri((1 + coverage) / 2))


def of_few(errors: int) -> float:
    """How much wider an interval is whose standard deviation comes of so many errors than one that knows it.

    >>> round(of_few(10), 2), round(of_few(1000), 3)
    (1.11, 1.001)
    """
    return float(stdtrit(errors - 1, (1 + COVERAGE) / 2)) / normal(COVERAGE)


def _order(rows: int, coverage: float) -> int:
    """Which of so many sorted ratios holds this part of new ones, from 1; the last where none does."""
    return min(math.ceil((rows + 1) * coverage), rows)


def sure_coverage(rows: int, coverage: float = COVERAGE) -> float:
    """The coverage that intervals calibrated on `rows` rows have but in UNLUCKY of all draws of these rows.

    The k-th of n sorted ratios covers a part that is Beta(k, n + 1 - k) distributed over such draws, whatever the
    errors (Vovk, Conditional validity of inductive conformal predictors, ACML 2012, proposition 2a).
    """
    k = _order(rows, coverage)
    return float(betaincinv(k, rows + 1 - k, UNLUCKY))


def describe_rows(rows: int) -> str:
    """In words, how many rows calibrate the 90 % intervals, and what these hold."""
    return (f"{rows} rows calibrate the {100 * COVERAGE:.0f} % intervals; of new rows like these they hold "
            f"{100 * sure_coverage(rows):.0f} % or more, in {100 * (1 - UNLUCKY):.0f} of 100 such calibrations.")


def few(rows: int) -> str:
    """In words, that so few rows calibrate intervals badly; empty where they are enough."""
    return "" if sure_coverage(rows) >= LEAST else (
        f"{rows} calibrating rows are few: the {100 * COVERAGE:.0f} % intervals may hold as little as "
        f"{100 * sure_coverage(rows):.0f} %, and one odd row may make them far too wide. Train on "
        f"more scenes, of which 15 % calibrate, or on --calibrate DIR, until {enough()} do.")


@cache
def enough() -> int:
    """Rows from which on intervals have a coverage of LEAST but in UNLUCKY of all draws."""
    return 1 + max(rows for rows in range(1, 1000) if sure_coverage(rows) < LEAST)


def conformal_scale(error: Array, sd: Array, rows: int, coverage: float = COVERAGE,
                    branched: Mask | None = None) -> Array:
    """(k,) factor of sd (n, k), on the side of the error, whose intervals hold this part of errors (n, k) made on
    `rows` different rows.

    The order statistic is that of `rows` exchangeable errors. Few rows have none (fewer than 9 at 90 %, 19 at 95 %):
    then the largest ratio is taken, or the normal factor where that is larger.

    branched: (k,) outputs with one of a few values, or with several answers to one signal. Rows sure of theirs have
    ratios near 0 and say nothing of rows in doubt, whose interval a factor below the normal one would draw from the
    branch that it ends on; so the factor of these outputs is never below that.
    """
    ratio = np.abs(error) / np.maximum(sd, np.finfo(float).tiny)
    too_few = math.ceil((rows + 1) * coverage) > rows
    floored = too_few if branched is None else branched | too_few
    least = np.where(floored, normal(coverage), 0.0)
    place = -(-_order(rows, coverage) * len(ratio) // rows) - 1
    return np.maximum(np.partition(ratio, place, axis=0)[place], least)


@dataclass(frozen=True, eq=False)
class IntervalScale:
    """How many standard deviations make an interval: one factor for rows sure of an output, one for the others, and
    one for rows of another kind, whose errors have nothing to do with these."""

    edge: Array  # (outputs,) standard deviation above which the second factor holds; infinite where there is one
    factor: Array  # (3, outputs)

    def of(self, sd: Array, other_kind: Mask) -> Array:
        """(n, outputs) factors of standard deviations (n, outputs) of rows of one kind and the other (n,)."""
        return np.where(other_kind[:, None], self.factor[2], np.where(sd > self.edge, self.factor[1], self.factor[0]))


def one_factor(factor: Array) -> IntervalScale:
    """The same factor (outputs,) whatever the standard deviation."""
    return IntervalScale(np.full(len(factor), np.inf), np.stack([factor] * 3))


def at_least(scale: IntervalScale, other: IntervalScale) -> IntervalScale:
    """Factors no smaller than those of another, whichever side of its edge a row is on where the edges differ."""
    largest = np.stack([other.factor[:2].max(axis=0)] * 2 + [other.factor[2]])
    return IntervalScale(scale.edge, np.maximum(scale.factor, np.where(
        scale.edge == other.edge, other.factor, largest)))


def conformal_scales(error: Array, sides: Array, sd: Array, rows: int, coverages: Sequence[float] = (COVERAGE,),
                     branched: Mask | None = None, other_kind: Mask | None = None,
                     shared: Mask | None = None) -> list[IntervalScale]:
    """Factors for each coverage, as `conformal_scale`, of standard deviations on the side of the errors (n, k); the
    outputs (k,) that are shared, as the coordinates of a place, have one, of all their errors. Rows of another kind
    (n,) have their own, where there are some of both kinds; of the rest, frames with the UNSURE largest sd (n, k) do
    where they are enough rows for LEAST (Mondrian conformal prediction: Vovk, Gammerman, Shafer, Algorithmic Learning
    in a Random World, 2005, section 4.5)."""
    outputs = sd.shape[1]
    one = np.zeros(outputs, bool) if shared is None else shared
    sets = [np.array([k]) for k in np.flatnonzero(~one)] + ([np.flatnonzero(one)] if one.any() else [])

    def factors(kept: Mask, coverage: float) -> Array:
        found = np.empty(outputs)
        for k in sets:
            some = kept[:, k]
            errors, side = error[:, k][some][:, None], sides[:, k][some][:, None]
            found[k] = conformal_scale(errors, side, max(round(rows * some.mean()), 1), coverage,
                                       None if branched is None else np.array([branched[k].any()]))
        return found

    usual = np.ones(len(error), bool)
    if other_kind is not None and not other_kind.all():
        usual = ~other_kind
    edge = np.quantile(sd[usual], 1 - UNSURE, axis=0)
    unsure = sd > edge
    edge[np.mean(unsure & usual[:, None], axis=0) * rows < enough()] = np.inf
    groups = [usual[:, None] & ((unsure == which) | np.isinf(edge)) for which in (False, True)]
    found = [np.array([factors(group, coverage) for group in groups]) for coverage in coverages]
    rest = np.repeat(~usual[:, None], outputs, axis=1)
    return [IntervalScale(edge, np.vstack([one, one.max(axis=0) if usual.all() else factors(rest, coverage)]))
            for one, coverage in zip(found, coverages, strict=True)]


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
        factor = of_few(count) * _steadied(order, MEAN_ERRORS * float(np.mean(np.abs(error) / sd)), count)
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
