"""The verdict on the first page of a report: what its numbers are good, usable or not usable for, and why."""

from dataclasses import dataclass, replace

GOOD, USABLE, NOT_USABLE = "good", "usable", "not usable"
_GRADES = (GOOD, USABLE, NOT_USABLE)

# Each pair: the largest value that is good, and the largest that is usable.
Limits = tuple[float, float]
MISFIT: Limits = (0.01, 0.05)  # relative RMS of a fit
HALF_WIDTH: Limits = (0.05, 0.20)  # half of a 95 % interval over its value
ERROR: Limits = (0.01, 0.05)  # estimated relative error of a simulated quantity
EXTRAPOLATED: Limits = (0.05, 0.25)  # share of the signal, or of the scenes, that rests on extrapolated laws
PAST_TEST: Limits = (0.01, 0.10)  # strain past the end of the tests
LOST: Limits = (0.01, 0.10)  # share of the scenes that did not end ok
UNEXPLAINED: Limits = (0.01, 0.10)  # 1 - R² on unseen rows
SHORTFALL: Limits = (0.05, 0.10)  # what intervals hold less than they say
SYNTHETIC = "the data are synthetic: nothing was measured"


@dataclass(frozen=True)
class Verdict:
    """One line of the verdict."""

    what: str  # the use that it is about
    grade: str  # GOOD, USABLE or NOT_USABLE
    why: str  # the numbers behind it


def graded(value: float, limits: Limits) -> str:
    """Grade of a value, of which less is better."""
    return _GRADES[sum(value > limit for limit in limits)]


def worst(*grades: str) -> str:
    """The worst of some grades."""
    return max(grades, key=_GRADES.index)


def no_better(verdict: Verdict, than: Verdict) -> Verdict:
    """A verdict, or with the grade of one that it rests on where that is worse, which it then names."""
    if worst(verdict.grade, than.grade) == verdict.grade:
        return verdict
    return replace(verdict, grade=than.grade, why=f"{verdict.why}; no better than \"{than.what}\"")


def real(what: str, synthetic: bool) -> list[Verdict]:
    """The line that keeps synthetic data from being taken for a measurement; none for measured ones."""
    return [Verdict(what, NOT_USABLE, SYNTHETIC)] if synthetic else []
