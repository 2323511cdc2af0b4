"""The verdict: the same words and limits in every report, first on the first page."""

import pytest

from reports.document import verdict
from reports.document.verdict import ERROR, GOOD, NOT_USABLE, USABLE, Verdict, graded, real, worst


@pytest.mark.parametrize(("value", "grade"), [(0.0, GOOD), (0.01, GOOD), (0.011, USABLE), (0.05, USABLE),
                                              (0.051, NOT_USABLE), (float("inf"), NOT_USABLE)])
def test_a_value_is_good_up_to_the_first_limit_and_usable_up_to_the_second(value: float, grade: str) -> None:
    assert graded(value, ERROR) == grade


def test_every_pair_of_limits_increases() -> None:
    pairs = {name: pair for name, pair in vars(verdict).items() if isinstance(pair, tuple) and name.isupper()
             and isinstance(pair[0], float)}
    assert len(pairs) > 5
    assert all(0 < good < usable < 1 for good, usable in pairs.values()), pairs


def test_the_worst_grade_counts_and_synthetic_data_are_never_usable_for_the_real_thing() -> None:
    assert worst(GOOD, NOT_USABLE, USABLE) == NOT_USABLE
    assert worst(GOOD, GOOD) == GOOD
    assert real("A real foam", True) == [Verdict("A real foam", NOT_USABLE, verdict.SYNTHETIC)]
    assert real("A real foam", False) == []
