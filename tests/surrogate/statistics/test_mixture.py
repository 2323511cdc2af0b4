"""Intervals of mixtures."""

import numpy as np
import pytest

from surrogate.statistics.mixture import interval


def test_one_member_keeps_its_own_ends_and_equal_ones_share_theirs() -> None:
    mode, below, above = np.array([[1.0], [2.0]]), np.array([[0.1], [0.3]]), np.array([[0.2], [0.4]])
    for members in (1, 3):
        each, short, far = (np.repeat(one, members, axis=1) for one in (mode, below, above))
        low, high = interval(each, short, far, 0.05)
        assert low == pytest.approx((mode - below)[:, 0])
        assert high == pytest.approx((mode + above)[:, 0])


def test_as_much_lies_outside_on_either_side_as_is_asked_for() -> None:
    rng, tail = np.random.default_rng(3), 0.05
    mode, scale = np.array([1.0, 1.3, 2.0]), np.array([[0.1, 0.2, 0.05], [0.3, 0.1, 0.4]])
    low, high = interval(mode, 1.6448536 * scale[0], 1.6448536 * scale[1], tail)
    which, off = rng.integers(0, 3, 400_000), rng.normal(size=400_000)
    drawn = mode[which] + off * np.where(off < 0, scale[0, which], scale[1, which])
    assert np.mean(drawn < low) == pytest.approx(tail, abs=2e-3)
    assert np.mean(drawn > high) == pytest.approx(tail, abs=2e-3)
