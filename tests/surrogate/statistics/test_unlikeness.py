"""Rows unlike the held-out ones are flagged or have wider intervals, and others seldom are."""

import numpy as np
import pytest

from surrogate.statistics.unlikeness import TOGETHER, learn_unlikeness
from touchcal.arrays import Array


def misfits(seed: int, rows: int, size: float = 1.0) -> Array:
    """Squared distances of normal errors in five and in ten dimensions, heavy-tailed between rows."""
    rng = np.random.default_rng(seed)
    common = size**2 * np.exp(0.5 * rng.standard_normal(rows))
    return np.stack([common * rng.chisquare(5, rows), common * rng.chisquare(10, rows)], axis=1)


@pytest.mark.parametrize("rows", [30, 100, 1000])
def test_rows_like_the_held_out_ones_are_seldom_odd_and_hardly_widened(rows: int) -> None:
    odd, wider, shift = [], [], []
    for seed in range(40):
        known, new = learn_unlikeness(misfits(seed, rows)), misfits(1000 + seed, 300)
        odd.append(known.odd(new).mean())
        wider.append(known.widening(new).mean())
        shift.append(known.shift(new))
    assert np.mean(odd) < 0.05
    assert np.mean(wider) < 1.06
    assert np.mean(shift) < 1.05


def test_errors_as_much_larger_as_the_root_of_the_misfit_are_held() -> None:
    known = learn_unlikeness(misfits(0, 500))
    many = known.widening(100 * misfits(1, 500))
    np.testing.assert_allclose(many, np.sqrt(known.ratio(100 * misfits(1, 500))))
    assert 5 < np.median(many) < 12
    assert known.odd(100 * misfits(1, 500)).mean() > 0.9


def test_a_change_of_all_rows_is_seen_where_single_rows_stay_usual() -> None:
    known, new = learn_unlikeness(misfits(0, 200)), misfits(1, 200, 1.7)
    assert known.odd(new).mean() < 0.3
    assert known.shift(new) > 1.25
    assert known.shift(new[:TOGETHER - 1]) == 1.0


def test_one_pattern_without_misfit_divides_by_nothing() -> None:
    known = learn_unlikeness(np.zeros((20, 2)))
    assert not known.odd(np.zeros((3, 2))).any()
    assert known.widening(np.zeros((3, 2))).tolist() == [1.0, 1.0, 1.0]
    assert known.shift(np.zeros((20, 2))) == 1.0
