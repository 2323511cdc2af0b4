"""Conformal factors, coverages and scores against counts and tables worked out by hand."""

import numpy as np
import pytest
from scipy.stats import binom, norm

from surrogate.statistics.conformal import (
    PRIOR_PRESSES,
    Intervals,
    IntervalScale,
    _steadied,
    at_least,
    calibrated,
    conformal_scale,
    conformal_scales,
    describe_rows,
    enough,
    few,
    normal,
    sure_coverage,
)
from surrogate.statistics.metrics import COVERAGES, rms, score


def test_the_normal_factor() -> None:
    assert normal(0.90) == pytest.approx(1.6449, abs=1e-4)
    assert norm.cdf(normal(0.95)) - norm.cdf(-normal(0.95)) == pytest.approx(0.95)


@pytest.mark.parametrize(("rows", "coverage", "order"), [
    (100, 0.90, 91), (19, 0.90, 18), (200, 0.95, 191), (5, 0.90, 5)])
def test_sure_coverage_fails_in_one_calibration_of_twenty(rows: int, coverage: float, order: int) -> None:
    """The k-th of n ratios covers less than p where at least k of n uniform numbers lie below p."""
    p = sure_coverage(rows, coverage)
    assert binom.sf(order - 1, rows, p) == pytest.approx(0.05, rel=1e-6)


def test_enough_rows_are_the_fewest_that_hold_85_percent() -> None:
    assert sure_coverage(enough()) >= 0.85 > sure_coverage(enough() - 1)
    assert few(enough()) == ""
    assert f"until {enough()} do" in few(enough() - 1)
    assert describe_rows(100).startswith("100 rows calibrate the 90 % intervals")
    assert f"hold {100 * sure_coverage(100):.0f} % or more, in 95 of 100" in describe_rows(100)


@pytest.mark.parametrize(("rows", "factor"), [(19, 18), (9, 9), (8, 8), (1, normal(0.90)), (100, 91)])
def test_the_factor_is_the_order_statistic_of_n_plus_one(rows: int, factor: float) -> None:
    """Ratios 1, 2, ..., n in any order: the ceil(0.9 (n + 1))-th, the last or the normal one where there is none."""
    error = np.random.default_rng(0).permutation(np.arange(1.0, rows + 1))[:, None] * [1.0, -2.0]
    assert conformal_scale(error, np.full((rows, 2), [1.0, 2.0]), rows) == pytest.approx(factor)


def test_the_largest_ratio_counts_among_few_rows_where_it_is_above_the_normal_factor() -> None:
    sd = np.ones((5, 1))
    for rows, factor in ((5, normal(0.90)), (8, normal(0.90)), (9, 0.1)):
        assert conformal_scale(np.full((rows, 1), 0.1), np.ones((rows, 1)), rows) == pytest.approx(factor)
    assert conformal_scale(3.0 * sd, sd, 5) == pytest.approx(3.0)


def test_several_errors_a_row_and_outputs_of_few_values() -> None:
    """19 rows with two errors each: the 36th of 38; a discrete output never below the normal factor."""
    error = np.arange(1.0, 39)[:, None] * np.ones(2) / 100
    found = conformal_scale(error, np.ones((38, 2)), 19, branched=np.array([False, True]))
    assert found == pytest.approx([0.36, normal(0.90)])


def test_scores_by_hand() -> None:
    """Errors 1, -1, 3, -1 on targets 0, 2, 4, 6, whose variance is 5."""
    target, value = np.array([0.0, 2.0, 4.0, 6.0]), np.array([1.0, 1.0, 7.0, 5.0])
    half = np.array([[0.5, 1.0, 2.0, 1.0], [1.0, 1.0, 3.0, 2.0], [4.0] * 4])
    found = score(target, value, half, half, "mm")
    assert (found.mse, found.rmse, found.mae, found.n, found.unit) == (3.0, pytest.approx(3**0.5), 1.5, 4, "mm")
    assert found.r2 == pytest.approx(1 - 3 / 5)
    assert (found.coverage_50, found.coverage_90, found.coverage_95) == (0.5, 1.0, 1.0)
    assert found.half_width_90 == 1.5
    assert COVERAGES == (0.50, 0.90, 0.95)
    assert score(np.full(4, 7.0), value, half, half, "mm").r2 is None
    assert score(1e-3 * target, 1e-3 * value, half, half, "m").r2 == pytest.approx(1 - 3 / 5)
    assert rms(np.array([3.0, -4.0])) == pytest.approx(12.5**0.5)


def test_rows_in_doubt_have_a_factor_of_their_own() -> None:
    """Where standard deviations of unsure rows are three times too small, one factor holds 90 % of all rows and far
    fewer of those; two factors hold 90 % of each."""
    rng = np.random.default_rng(4)
    rows = 4 * enough()
    sd = rng.uniform(0.5, 1.0, (2 * rows, 1)) + np.arange(2 * rows)[:, None] // (2 * rows * 3 // 4)
    error = rng.normal(size=sd.shape) * np.where(sd > 1.4, 3.0, 1.0) * sd
    order = rng.permutation(2 * rows)
    seen, unseen = order[:rows], order[rows:]
    two, = conformal_scales(error[seen], sd[seen], sd[seen], rows)
    one = conformal_scale(error[seen], sd[seen], rows)
    held = np.abs(error[unseen]) <= two.of(sd[unseen], np.zeros(rows, bool)) * sd[unseen]
    unsure = sd[unseen] > 1.4
    assert np.mean((np.abs(error[unseen]) <= one * sd[unseen])[unsure]) < 0.75
    assert np.mean(held[unsure]) > 0.82
    assert np.mean(held) == pytest.approx(0.9, abs=0.06)


def test_rows_of_another_kind_have_a_factor_of_their_own_however_few_they_are() -> None:
    """Standard deviations of every third row are four times too small; one factor holds 90 % of all, fewer of these."""
    rng = np.random.default_rng(7)
    other = np.arange(600) % 3 == 0
    sd = rng.uniform(0.5, 2.0, (600, 1))
    error = rng.normal(size=sd.shape) * np.where(other, 4.0, 1.0)[:, None] * sd
    found, = conformal_scales(error[:120], sd[:120], sd[:120], 120, other_kind=other[:120])
    held = (np.abs(error) <= found.of(sd, other) * sd)[120:, 0]
    one = conformal_scale(error[:120], sd[:120], 120)
    assert np.mean((np.abs(error) <= one * sd)[120:, 0][other[120:]]) < 0.75
    for kind in (other, ~other):
        assert 0.82 < np.mean(held[kind[120:]]) < 0.97
        assert found.factor[2 if kind is other else 0] == pytest.approx(
            conformal_scale(error[:120][kind[:120]], sd[:120][kind[:120]], int(kind[:120].sum())))
    pair = np.hstack([error, error[::-1]])[:120]
    both, = conformal_scales(pair, np.tile(sd[:120], 2), np.tile(sd[:120], 2), 120, other_kind=other[:120],
                             shared=np.ones(2, bool))
    apart, = conformal_scales(pair, np.tile(sd[:120], 2), np.tile(sd[:120], 2), 120, other_kind=other[:120])
    for of_kind, each in zip(both.factor[[0, 2]], apart.factor[[0, 2]], strict=True):
        assert of_kind[0] == of_kind[1]
        assert each.min() < of_kind[0] < each.max()
    ratio = np.sort(np.abs(pair / sd[:120])[other[:120]].ravel())
    assert both.factor[2, 0] == ratio[2 * 37 - 1]  # 40 rows, of which the 37th of 41 holds 90 %
    alone, = conformal_scales(error[:120], sd[:120], sd[:120], 120, other_kind=np.ones(120, bool))
    assert np.array_equal(alone.factor[2], alone.factor[:2].max(axis=0))


def test_few_rows_have_one_factor() -> None:
    rng = np.random.default_rng(5)
    error, sd = rng.normal(size=(200, 2)), rng.uniform(0.5, 2.0, (200, 2))
    found, = conformal_scales(error, sd, sd, 200)
    assert np.isinf(found.edge).all()
    assert np.array_equal(found.of(sd, np.zeros(200, bool)), np.tile(conformal_scale(error, sd, 200), (200, 1)))


def test_equal_standard_deviations_have_one_factor() -> None:
    error = np.random.default_rng(6).normal(size=(1000, 1))
    found, = conformal_scales(error, np.ones_like(error), np.ones_like(error), 1000)
    assert np.isinf(found.edge).all()


def test_factors_are_at_least_those_of_another_scale_whatever_its_edge() -> None:
    one, two = (IntervalScale(np.array([edge]), np.array([[1.0], [high], [high]]))
                for edge, high in ((np.inf, 1.0), (0.5, 3.0)))
    one_kind = np.zeros(2, bool)
    assert at_least(one, two).of(np.array([[0.1], [2.0]]), one_kind).tolist() == [[3.0], [3.0]]
    assert at_least(two, one).of(np.array([[0.1], [2.0]]), one_kind).tolist() == [[1.0], [3.0]]


def test_a_steadied_scale_goes_from_the_steady_one_to_that_of_the_order_as_presses_grow() -> None:
    found = [_steadied(1.0, 4.0, presses) for presses in (0, PRIOR_PRESSES, 10**9)]
    assert found == pytest.approx([4.0, 2.0, 1.0], rel=1e-6)


def test_each_part_of_the_rows_has_the_order_statistic_of_its_own_count() -> None:
    """145 rows in doubt: the 132nd of theirs; 290 sure ones: the 262nd; ratios are whole numbers."""
    rng = np.random.default_rng(4)
    sd = np.repeat([1.0, 2.0], [290, 145])[:, None]
    ratio = np.concatenate([rng.permutation(np.arange(1.0, 291)), rng.permutation(np.arange(1.0, 146))])[:, None]
    (found,) = conformal_scales(ratio * sd, sd, sd, 435)
    assert 1.0 <= found.edge[0] < 2.0
    assert found.factor[:, 0].tolist() == [262.0, 132.0, 262.0]


def test_half_widths_and_correlations_by_hand() -> None:
    """Spreads 4 and 12 with floors 3 and 5; covariances over the product of both."""
    assert Intervals(3.0, 2.0, 0.0, 1.0).half_width(np.array([[4.0]])) == pytest.approx(10.0)
    found = Intervals(5.0, 2.0, 0.25, 1.5).bounds(np.array([[12.0, 12.0], [12.0, 0.0]]), np.array([0.0, 13.0]))
    assert found.half_width == pytest.approx(np.array([[26.0, 26.0], [26.0, 10.0]]))
    assert found.correlation == pytest.approx([0.25, 0.45])
    assert found.ellipse.tolist() == [1.5, 1.5]
    assert Intervals(5.0, 2.0, -0.9, 1.5).bounds(np.zeros((1, 2)), np.array([-25.0])).correlation == [-0.95]


def test_the_correlation_is_that_of_held_out_errors_less_what_spreads_say() -> None:
    """Errors of x and y equal in 60 of 75 rows and opposite in 15: 0.6, which 50 rows of none are taken against."""
    error = np.ones((75, 2))
    error[::5, 1] = -1
    found = calibrated(error, np.ones((75, 2)), np.zeros(75))
    assert found.correlation == pytest.approx(0.6 * 75 / (75 + 50))
    said = calibrated(error, np.ones((75, 2)), np.full(75, 0.6 * (1 + found.floor**2)))
    assert said.correlation == pytest.approx(0.0, abs=1e-12)
