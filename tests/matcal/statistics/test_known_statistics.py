"""Block means, noise, marginals and correlated errors against dense formulas written out here."""

import numpy as np
import pytest

from matcal.statistics.block_means import block_means, equal_blocks, log_blocks, sample_noise
from matcal.statistics.linear_marginals import conditional, log_marginal, triangles
from matcal.statistics.residual_correlation import (
    _SIZES,
    _grid,
    _sums,
    _weights,
    correlated_errors,
    integrated_autocorrelation_time,
)


def test_noise_of_a_straight_record_is_its_standard_deviation() -> None:
    line = np.linspace(3, -40, 20000)
    noise = 0.7 * np.random.default_rng(0).normal(size=line.size)
    assert sample_noise(line + noise) == pytest.approx(0.7, rel=0.02)
    assert sample_noise(np.array([0.0, 1.0, 0.0])) == pytest.approx(1.4826 * 2 / 6**0.5)
    assert sample_noise(line[:2]) == 0


def test_blocks_and_their_means() -> None:
    assert equal_blocks(10, 4).tolist() == [0, 2, 4, 6, 8, 10]
    assert equal_blocks(11, 4).tolist() == [1, 3, 5, 7, 9, 11]
    assert equal_blocks(3, 10).tolist() == [0, 1, 2, 3]
    values = np.array([5.0, 7.0, 1.0, 2.0, 3.0, 10.0])
    assert block_means(values, np.array([0, 2, 5, 6])).tolist() == [6.0, 2.0, 10.0]
    assert block_means(values, np.array([1, 3, 6])).tolist() == [4.0, 5.0]


def test_logarithmic_blocks_grow_by_one_factor() -> None:
    """From the second sample on, 0.1 s, to 1000 s in 4 factors of 10."""
    time = 7.0 + 0.1 * np.arange(10001)
    edges = log_blocks(time, 5)
    assert edges.tolist() == [0, 1, 11, 101, 1001, 10001]
    assert log_blocks(time[:2], 5).tolist() == [0, 1, 2]
    assert log_blocks(time[:3], 2).tolist() == [0, 1, 3]


def test_samples_of_one_time_stay_in_one_logarithmic_block() -> None:
    """A clock that repeats its first time stamp, and a later one."""
    time = 7.0 + np.array([0.0, 0.0, 0.0, 0.1, 1.0, 1.0, 10.0])
    assert log_blocks(time, 3).tolist() == [0, 3, 6, 7]
    assert log_blocks(np.full(5, 7.0), 3).tolist() == [0, 5]


def test_a_linear_parameter_is_integrated_out() -> None:
    """target = columns x + N(0, 1), x ~ N(mean, root^-2): ln N(target; columns mean, 1 + columns S columns')."""
    rng = np.random.default_rng(1)
    columns, target = rng.normal(size=(3, 6, 2)), rng.normal(size=(3, 6))
    root, mean = np.array([0.5, 2.0]), np.array([1.0, -0.3])
    expected = []
    for a, y in zip(columns, target, strict=True):
        covariance = np.eye(6) + a @ np.diag(root**-2) @ a.T
        left = y - a @ mean
        expected.append(-0.5 * left @ np.linalg.solve(covariance, left) - 0.5 * np.linalg.slogdet(covariance)[1])
    found = log_marginal(triangles(columns, target, root, mean))
    assert np.diff(found) == pytest.approx(np.diff(expected), rel=1e-9)


def test_draws_of_a_linear_parameter_have_its_posterior() -> None:
    rng = np.random.default_rng(2)
    a, y = rng.normal(size=(6, 2)), rng.normal(size=6)
    root, mean = np.array([0.5, 2.0]), np.array([1.0, -0.3])
    precision = a.T @ a + np.diag(root**2)
    expected = np.linalg.solve(precision, a.T @ y + root**2 * mean)
    many = 40000
    draws = conditional(triangles(np.tile(a, (many, 1, 1)), np.tile(y, (many, 1)), root, mean), rng)
    sd = np.sqrt(np.diag(np.linalg.inv(precision)))
    assert draws.mean(axis=0) == pytest.approx(expected, abs=5 * float(sd.max()) / many**0.5)
    assert np.cov(draws.T) == pytest.approx(np.linalg.inv(precision), abs=0.03 * float(sd.max()) ** 2)


def _errors(seed: int, memory: float, n: int = 150, least: float = 0.0):
    """Errors of variance 4 with correlation memory^|i - j| about a line that was fitted."""
    rng = np.random.default_rng(seed)
    white, error = rng.normal(size=n), np.empty(n)
    error[0] = white[0]
    for k in range(1, n):
        error[k] = memory * error[k - 1] + np.sqrt(1 - memory**2) * white[k]
    slopes = np.column_stack([np.ones(n), np.linspace(-1, 1, n)])
    residual = 2 * error - slopes @ np.linalg.lstsq(slopes, 2 * error, rcond=None)[0]
    return correlated_errors([residual], [slopes], 1e-8 * np.eye(2), [least])[0]


@pytest.mark.parametrize(("memory", "tolerance"), [(0.0, 0.15), (0.7, 0.3), (0.9, 0.45)])
def test_size_and_correlation_of_errors_are_found(memory: float, tolerance: float) -> None:
    """Variance 4, correlation rho^k, n (1 - rho)/(1 + rho) points' worth, by the mean of the logarithm of 12 records.
    """
    found = [_errors(seed, memory) for seed in range(12)]
    size = np.exp(np.mean([np.log(e.covariance[0, 0]) for e in found]))
    worth = np.exp(np.mean([np.log(e.effective_sample_size) for e in found]))
    assert size == pytest.approx(4.0, rel=tolerance)
    assert np.mean([e.covariance[40, 41] / e.covariance[40, 40] for e in found]) == pytest.approx(memory, abs=0.12)
    assert worth == pytest.approx(150 * (1 - memory) / (1 + memory), rel=0.5)


def test_probabilities_of_correlations_are_those_of_restricted_likelihood() -> None:
    """ln L = -1/2 [ln|V| + ln|A| + r'V^-1 r - b'A^-1 b] with V = u s R, A and b of both curves and the prior; half the
    weight beforehand on white errors."""
    rng = np.random.default_rng(7)
    r, x, other, y = rng.normal(size=12), rng.normal(size=(12, 2)), rng.normal(size=9), rng.normal(size=(9, 2))
    prior, unit = np.diag([0.3, 0.1]), 1.7
    lags = np.abs(np.subtract.outer(range(12), range(12)))
    grid = [np.eye(12), np.exp(-lags / 2.0), 0.9 * np.exp(-lags / 4.0) + 0.1 * np.eye(12)]
    found = _weights([_sums(np.linalg.cholesky(c), r, x) for c in grid], unit, [_sums(np.eye(9), other, y)], prior)
    log = np.empty((3, _SIZES.size))
    for i, correlation in enumerate(grid):
        for j, size in enumerate(_SIZES):
            v = unit * size * correlation
            a = x.T @ np.linalg.solve(v, x) + y.T @ y + prior
            b = x.T @ np.linalg.solve(v, r) + y.T @ other
            log[i, j] = -0.5 * (np.linalg.slogdet(v)[1] + np.linalg.slogdet(a)[1] + r @ np.linalg.solve(v, r)
                                - b @ np.linalg.solve(a, b)) - (np.log(2) if i else 0)
    expected = np.exp(log - log.max())
    assert found == pytest.approx(expected / expected.sum(), rel=1e-5, abs=1e-12)


@pytest.mark.parametrize("n", [3, 40, 160])
def test_correlations_reach_from_less_than_a_point_to_a_quarter_of_the_record(n: int) -> None:
    """White noise, then eight lengths of one ratio from 0.7 to n/4, each with 0, 3, 15 and 50 % of white noise; sizes
    from e^-1.5 to e^2.5 times the residual's variance."""
    white, *slow = _grid(n)
    assert white == pytest.approx(np.eye(n))
    assert len(slow) == 8 * 4
    lags = np.abs(np.subtract.outer(range(n), range(n)))
    lengths = np.repeat(np.geomspace(0.7, max(n / 4, 1.0), 8), 4)
    for correlation, length, share in zip(slow, lengths, np.tile([0.0, 0.03, 0.15, 0.5], 8), strict=True):
        np.testing.assert_allclose(correlation, (1 - share) * np.exp(-lags / length) + share * np.eye(n), rtol=1e-12)
    assert np.log(_SIZES[[0, -1]]) == pytest.approx([-1.5, 2.5])


def test_what_errors_are_worth_and_do_follows_from_their_covariance() -> None:
    """n_eff = n^2 C_00/sum C; covariance of G e is G C G'; known noise is a lower bound of the size."""
    errors = _errors(3, 0.8)
    assert errors.effective_sample_size == pytest.approx(150**2 * errors.covariance[0, 0] / errors.covariance.sum())
    gain = np.random.default_rng(4).normal(size=(3, 150))
    assert errors.of(gain) == pytest.approx(gain @ errors.covariance @ gain.T, rel=1e-10)
    assert _errors(3, 0.8, least=10.0).covariance[0, 0] == pytest.approx(100.0)
    assert _errors(3, 0.8, least=0.1).covariance == pytest.approx(errors.covariance)


def test_long_records_are_judged_by_means_of_blocks() -> None:
    """450 points in 200 blocks of two or three: errors of white noise of variance 4 keep 4/2.25 in a mean."""
    errors = _errors(5, 0.0, n=450)
    assert errors.covariance.shape == (200, 200)
    assert errors.covariance[0, 0] == pytest.approx(4 / 2.25, rel=0.25)
    assert errors.count == 450
    gain = np.ones((1, 450)) / 450
    assert errors.of(gain)[0, 0] == pytest.approx(4 / 450, rel=0.9)
    assert _errors(5, 0.0, n=450, least=20.0).covariance[0, 0] == pytest.approx(400 * 200 / 450)


def test_a_record_whose_points_are_written_twice_or_thrice_says_the_same() -> None:
    """Two hundred points, each repeated as often as a block of 450 points is long: the blocks are these points."""
    rng, prior = np.random.default_rng(8), 1e-8 * np.eye(2)
    residual, slopes = rng.normal(size=200), np.column_stack([np.ones(200), np.linspace(-1, 1, 200) ** 3])
    often = np.diff(np.linspace(0, 450, 201).astype(int))
    (once,) = correlated_errors([residual], [slopes], prior, [0.0])
    (more,) = correlated_errors([np.repeat(residual, often)], [np.repeat(slopes, often, axis=0)], prior, [0.0])
    assert set(often) == {2, 3}
    assert more.covariance == pytest.approx(once.covariance, rel=1e-9)
    assert more.effective_sample_size == pytest.approx(once.effective_sample_size, rel=1e-9)


def test_autocorrelation_time_of_an_autoregressive_record() -> None:
    """(1 + rho)/(1 - rho) for correlation rho^k; 1 for an alternating record."""
    rng, record = np.random.default_rng(6), np.zeros(40000)
    for k in range(1, record.size):
        record[k] = 0.8 * record[k - 1] + rng.normal()
    assert integrated_autocorrelation_time(record) == pytest.approx(9.0, rel=0.12)
    assert integrated_autocorrelation_time(np.tile([1.0, -1.0], 50)) == 1.0
    assert integrated_autocorrelation_time(np.ones(30)) > 10
