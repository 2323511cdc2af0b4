"""Whether measured intervals hold as much as they promise: an exact binomial test."""

from dataclasses import dataclass

import numpy as np
from scipy.special import bdtr

from surrogate.statistics.conformal import COVERAGE

UNLIKELY = 0.01  # chance of so few among all checks that are made together, below which luck is no excuse
TOLERATED = 0.02  # part by which a share may lie below the nominal one: of many rows a smaller lack is sure, and small


@dataclass(frozen=True)
class CoverageCheck:
    """How many of n independent intervals hold their targets, against what they promise."""

    nominal: float  # part that is promised
    measured: float  # part that was held
    n: int  # independent rows: presses where several frames show one press
    chance: float  # of so few or fewer where the promise is kept
    too_low: bool  # whether that is no luck, and the lack more than TOLERATED


def coverage_check(measured: float, n: int, nominal: float = COVERAGE, checks: int = 1) -> CoverageCheck:
    """One-sided binomial test of a share measured on n independent rows: P(K <= measured n), K ~ Bin(n, nominal),
    against UNLIKELY over the number of checks made together (Bonferroni).

    ValueError for n below 1 or a share outside 0 to 1.

    >>> coverage_check(0.62, 300).too_low, coverage_check(0.88, 100).too_low, coverage_check(0.8, 10).too_low
    (True, False, False)
    """
    if n < 1 or not 0 <= measured <= 1:
        raise ValueError(f"a share of {measured} of {n} rows is none; give 0 to 1 of one row or more.")
    chance = float(bdtr(np.floor(measured * n + 0.5), n, nominal))
    return CoverageCheck(nominal, measured, n, chance, chance < UNLIKELY / checks and measured < nominal - TOLERATED)


def in_words(check: CoverageCheck, name: str) -> str:
    """One sentence on intervals of a name that hold too little."""
    return (f"{name}: the {100 * check.nominal:.0f} % intervals hold {100 * check.measured:.0f} % of {check.n}, "
            "fewer than chance allows: do not rely on them here.")
