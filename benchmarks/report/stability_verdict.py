"""What laws, touches, holds, skins and surrogates at the ends of their ranges are good for."""

import math
from collections.abc import Callable, Iterator, Mapping

from benchmarks.report.stability_numerics import HISTORY, MANY, OF_DISC, SOME, digits_of
from benchmarks.report.stability_readings import cell
from benchmarks.report.stability_scenes import lost_scenes, not_elliptic
from benchmarks.report.state_map import LOST as LOST_CELL
from benchmarks.report.stored_tables import Rows, distinct, where
from reports.document.numerals import counted, number
from reports.document.verdict import GOOD, LOST, NOT_USABLE, USABLE, Verdict, graded

OWN = "eitsim"


def verdict(stored: Mapping[str, Rows]) -> list[Verdict]:
    """The lines of stored tables by their stem; KeyError where one lacks a column."""
    return [line for stem, of in _LINES.items() if stem in stored for line in of(stored[stem])]


def _laws(rows: Rows) -> Iterator[Verdict]:
    laws, names = distinct(rows, "law"), {"elliptic": "strong ellipticity", "drucker": "Drucker's condition"}
    losing = {criterion: distinct(where(rows, state="lost", criterion=criterion), "law") for criterion in names}
    grade = NOT_USABLE if losing["elliptic"] else USABLE if losing["drucker"] else GOOD
    said = [f"{len(found)} of {len(laws)} lose {names[criterion]} somewhere" for criterion, found in losing.items()]
    yield Verdict("These laws at every strain", grade, ", ".join(said))


def _scenes(rows: Rows) -> Iterator[Verdict]:
    lost, weak = len(lost_scenes(rows)), len(not_elliptic(rows))
    yield Verdict("Touches anywhere on the disc", graded(lost / len(rows), LOST),
                  f"{lost} of {counted(len(rows), 'random scene')} lost, {weak} ended with points not elliptic")


def _holds(rows: Rows) -> Iterator[Verdict]:
    own = where(rows, what=HISTORY)
    if own:
        yield _rounded("Stress while a foam is held", max(digits_of(row["error"]) for row in own),
                       f"time ratios to {number(max(row['ratio'] for row in own), 2)}")


def _skins(rows: Rows) -> Iterator[Verdict]:
    own = where(rows, of=OF_DISC, method=OWN)
    if own:
        lost = max(row["digits_lost"] if row["outcome"] == "solved" else math.inf for row in own)
        yield _rounded("Readings of any conductance", lost,
                       f"contrasts to {number(max(max(c, 1 / c) for c in distinct(own, 'contrast')), 2)}")


def _rounded(what: str, digits: float, over: str) -> Verdict:
    words = f"at most {digits:.1f} of 16 digits are lost" if math.isfinite(digits) else "some have no answer"
    return Verdict(what, graded(digits, (SOME, MANY)), f"{words}, over {over}")


def _readings(rows: Rows) -> Iterator[Verdict]:
    for method in distinct(rows, "method"):
        own = where(rows, method=method)
        lost = [row["case"] for row in own if cell(row["rmse_ratio"], row["coverage_90"]).state == LOST_CELL]
        kept = [case for case in distinct(where(own, kind="noise"), "case") if case not in {*lost, "none"}]
        yield Verdict(f"“{method}” under noise and shift", graded(len(lost) / len(own), LOST),
                      f"{len(lost)} of {counted(len(own), 'output')} lost; all outputs hold "
                      + (f"at noise of {', '.join(kept)}" if kept else "at none of the levels of noise"))


_LINES: dict[str, Callable[[Rows], Iterator[Verdict]]] = {
    "stable_ranges": _laws, "random_scenes": _scenes, "relaxation_stiff": _holds, "electrics_stiff": _skins,
    "surrogate_noise": _readings}
