"""Intervals that hold less than they promise are noticed, and those that do not are not."""

import numpy as np
import pytest

from surrogate.statistics.coverage_check import UNLIKELY, coverage_check


def test_chance_is_the_sum_of_binomial_terms() -> None:
    terms = [0.1**5, 5 * 0.9 * 0.1**4, 10 * 0.9**2 * 0.1**3]
    assert coverage_check(0.4, 5).chance == pytest.approx(sum(terms))


@pytest.mark.parametrize("n", [20, 100, 1000])
@pytest.mark.parametrize("nominal", [0.5, 0.9, 0.95])
def test_a_kept_promise_is_seldom_doubted(n: int, nominal: float) -> None:
    held = np.random.default_rng(n).binomial(n, nominal, 4000) / n
    doubted = np.mean([coverage_check(one, n, nominal).too_low for one in held])
    assert doubted <= 1.5 * UNLIKELY


def test_a_broken_promise_is_noticed() -> None:
    held = np.random.default_rng(0).binomial(100, 0.7, 1000) / 100
    assert np.mean([coverage_check(one, 100).too_low for one in held]) > 0.99


def test_a_sure_but_small_lack_is_tolerated() -> None:
    assert coverage_check(0.89, 100_000).chance < 1e-9
    assert not coverage_check(0.89, 100_000).too_low


def test_checks_made_together_share_the_chance() -> None:
    assert coverage_check(0.8, 100).too_low
    assert not coverage_check(0.8, 100, checks=20).too_low


@pytest.mark.parametrize(("measured", "n"), [(1.1, 10), (0.5, 0), (float("nan"), 3)])
def test_no_share_is_refused(measured: float, n: int) -> None:
    with pytest.raises(ValueError, match="share"):
        coverage_check(measured, n)
