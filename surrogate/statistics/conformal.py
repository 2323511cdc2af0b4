"""Split-conformal intervals: how many standard deviations hold so many of the validation rows (Lei et al. 2018)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import bdtr, bdtrc, betaincinv, ndtri

from touchcal.arrays import Array, Mask

COVERAGE = 0.90
# Part of the calibrating rows, those of largest standard deviations, that has a factor of its own where it is enough.
UNSURE = 1 / 3
# Chance that the calibration rows drawn leave a lower coverage than is said, and the least that is not cautioned.
UNLUCKY, LEAST = 0.05, 0.85
CHANCE = 0.01  # of a coverage as far off by chance, below which it is stated


def off_nominal(held: float, rows: int, coverage: float = COVERAGE) -> str:
    """In words, that intervals hold too small or too large a part of so many rows for chance, of a binomial
    probability below CHANCE; empty where they do not."""
    count = round(held * rows)
    fewer, more = bdtr(count, rows, coverage), bdtrc(count - 1, rows, coverage) if count else 1.0
    if rows == 0 or min(fewer, more) >= CHANCE / 2:
        return ""
    return (f"the {100 * coverage:.0f} % intervals hold {100 * held:.0f} % of {rows} rows, "
            f"{'fewer' if fewer < more else 'more'} than chance makes: they are too "
            f"{'narrow' if fewer < more else 'wide'} there")


def normal(coverage: float) -> float:
    """Standard deviations about the mean that hold this part of a normal variable."""
    return float(ndtri((1 + coverage) / 2))


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
    """Factors for each coverage, as `conformal_scale`, of standard deviations on the side of the errors (n, k). Rows of
    another kind (n,) have their own, where there are some of both kinds, and the outputs (k,) that are shared have one
    there; of the rest, frames with the UNSURE largest sd (n, k) do where they are enough rows for LEAST (Mondrian
    conformal prediction: Vovk, Gammerman, Shafer, Algorithmic Learning in a Random World, 2005, section 4.5)."""
    if other_kind is not None and other_kind.any() and not other_kind.all():
        (one, ones), (other, others) = ((kept, max(round(rows * kept.mean()), 1)) for kept in (~other_kind, other_kind))
        usual = conformal_scales(error[one], sides[one], sd[one], ones, coverages, branched)
        return [IntervalScale(scale.edge, np.vstack([scale.factor[:2], _of_outputs(
            error[other], sides[other], others, coverage, branched, shared)]))
            for scale, coverage in zip(usual, coverages, strict=True)]
    edge = np.quantile(sd, 1 - UNSURE, axis=0)
    unsure = sd > edge
    edge[np.mean(unsure, axis=0) * rows < enough()] = np.inf

    def factor(k: int, kept: Mask, coverage: float) -> float:
        return float(conformal_scale(error[kept][:, [k]], sides[kept][:, [k]], max(round(rows * kept.mean()), 1),
                                     coverage, None if branched is None else branched[[k]])[0])

    groups = [[(unsure[:, k] == which) | np.isinf(edge[k]) for k in range(len(edge))] for which in (False, True)]
    found = [np.array([[factor(k, kept, c) for k, kept in enumerate(group)] for group in groups]) for c in coverages]
    return [IntervalScale(edge, np.vstack([one, one.max(axis=0)])) for one in found]


def _of_outputs(error: Array, sides: Array, rows: int, coverage: float, branched: Mask | None,
                shared: Mask | None) -> Array:
    """(k,) as `conformal_scale`, but one for the outputs (k,) that are shared, of all their errors."""
    found = conformal_scale(error, sides, rows, coverage, branched)
    if shared is not None and shared.any():
        one, side = (values[:, shared].reshape(-1, 1) for values in (error, sides))
        found[shared] = conformal_scale(one, side, rows, coverage)
    return found
