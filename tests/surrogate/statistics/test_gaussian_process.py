from functools import partial

import numpy as np
import pytest
from scipy.stats import norm

from surrogate.statistics import gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess


def surface(x: np.ndarray) -> np.ndarray:
    return np.sin(3 * x[:, 0]) + x[:, 1] ** 2 + 0.01 * x[:, 2]


def points(rows: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random((rows, 3)) * [1, 2, 100]


@pytest.mark.parametrize("noise", [1e-4, 0.1])
def test_it_finds_the_noise_and_the_surface(noise: float) -> None:
    x, at = points(140, 0), points(1000, 2)
    process = gaussian_process.fit(x, surface(x) + noise * np.random.default_rng(1).normal(size=140))
    assert np.sqrt(process.noise[0]) == pytest.approx(noise, rel=0.3)
    assert np.sqrt(np.mean((gaussian_process.predict(process, at)[0] - surface(at)) ** 2)) < 1.5 * noise


def test_its_variance_is_that_of_its_own_prior() -> None:
    """Surfaces drawn from the prior, trend included: the 90 % interval holds 90 % of them."""
    rng, inside = np.random.default_rng(0), []
    for _ in range(60):
        x = rng.random((60, 2))
        truth = _draw_from_prior(x, rng)
        process = GaussianProcess(x[:40] / 0.4, np.zeros(2), np.full(2, 0.4), 1.0, np.full(40, 0.04),
                                  truth[:40] + 0.2 * rng.normal(size=40))
        mean, _, variance = gaussian_process.predict(process, x[40:])
        inside.append(np.abs(mean - truth[40:]) < 1.645 * np.sqrt(variance))
    assert np.mean(inside) == pytest.approx(0.9, abs=0.025)


def _draw_from_prior(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    squared = np.sum((x[:, None] - x) ** 2, axis=2) / 0.4**2
    covariance = np.exp(-0.5 * squared) + 1e-10 * np.eye(len(x))
    return np.linalg.cholesky(covariance) @ rng.normal(size=len(x)) + 30 * rng.normal() + x @ (30 * rng.normal(size=2))


def test_gradient_equals_finite_differences() -> None:
    x = points(60, 0)
    process = gaussian_process.fit(x, surface(x))
    at, steps = points(5, 3), np.diag([1e-4, 1e-4, 1e-2])
    _, gradient, _ = gaussian_process.predict(process, at)
    for q, h in enumerate(steps):
        change = gaussian_process.predict(process, at + h)[0] - gaussian_process.predict(process, at - h)[0]
        assert np.allclose(gradient[:, q], change / (2 * h[q]), atol=1e-6)


def test_likelihood_gradient_equals_finite_differences() -> None:
    x = points(30, 0)
    squared, shape = (x[:, None] - x) ** 2 / np.std(x, axis=0) ** 2, np.linspace(0.5, 2, 30)
    at = np.array([0.3, 0.1, 1.0, -3.0])
    value = partial(gaussian_process._negative_log_posterior, squared=squared, y=surface(x), shape=shape)
    steps = [(value(at + h)[0] - value(at - h)[0]) / 2e-5 for h in 1e-5 * np.eye(4)]
    assert np.allclose(value(at)[1], steps, rtol=1e-6)


def test_unequal_noise_is_weighed() -> None:
    x, rng = points(120, 0), np.random.default_rng(1)
    sd = np.where(np.arange(120) % 2, 1.0, 1e-3)
    y = surface(x) + sd * rng.normal(size=120)
    at = points(300, 2)
    error = [np.sqrt(np.mean((gaussian_process.predict(gaussian_process.fit(x, y, v), at)[0] - surface(at)) ** 2))
             for v in (None, sd**2)]
    assert error[1] < 0.05 * error[0]


def test_a_constant_input_is_harmless() -> None:
    x = points(40, 0)
    x[:, 2] = 7.0
    process = gaussian_process.fit(x, surface(x))
    assert np.allclose(gaussian_process.predict(process, x)[0], surface(x), atol=1e-3)


def test_too_few_rows_are_refused() -> None:
    with pytest.raises(ValueError, match="4 rows are too few to learn from 3 inputs"):
        gaussian_process.fit(points(4, 0), np.arange(4.0))
    assert gaussian_process.fit(points(5, 0), np.arange(5.0)).nodes.shape == (5, 3)


def test_a_plane_more_or_another_unit_of_the_noise_changes_no_hyperparameter() -> None:
    """With unequal noise: what is learned are lengths, amplitude and noise about a weighted plane."""
    x, rng = points(60, 0), np.random.default_rng(4)
    variance = np.where(np.arange(60) % 3, 1e-4, 1.0)
    y = surface(x) + np.sqrt(variance) * rng.normal(size=60)
    one = gaussian_process.fit(x, y, variance)
    for other in (gaussian_process.fit(x, y + 300 + x @ [7.0, -40.0, 0.5], variance),
                  gaussian_process.fit(x, y, 1e4 * variance)):
        np.testing.assert_allclose(other.lengths, one.lengths, rtol=1e-3)
        np.testing.assert_allclose(other.noise, one.noise, rtol=1e-3)
        assert other.amplitude == pytest.approx(one.amplitude, rel=1e-3)


def test_lengths_have_a_lognormal_prior() -> None:
    """Median of twice the spread of the input, standard deviation 0.7 of its logarithm."""
    x, at = points(20, 0), np.array([0.3, 1.1, 2.0, -3.0])
    given = (x[:, None] - x) ** 2 / np.std(x, axis=0) ** 2, surface(x), np.ones(20)

    def prior(log: np.ndarray) -> float:
        return (gaussian_process._negative_log_posterior(log, *given)[0]
                - gaussian_process._likelihood_and_gradient(log, *given)[0])

    for k in range(3):
        high, low = at.copy(), at.copy()
        high[k], low[k] = 1.9, -0.4
        expected = norm.logpdf([-0.4, 1.9], np.log(2.0), 0.7)
        assert prior(high) - prior(low) == pytest.approx(expected[0] - expected[1])


def test_the_amplitude_is_the_most_likely_one() -> None:
    """a^2 = r' C^-1 r/n, r what a weighted plane leaves, C the kernel and the noise over the amplitude."""
    x, variance = points(50, 0), np.linspace(1e-4, 1e-2, 50)
    y = surface(x) + np.sqrt(variance) * np.random.default_rng(5).normal(size=50)
    process = gaussian_process.fit(x, y, variance)
    plane, root = np.column_stack([np.ones(50), x]), np.sqrt(variance)
    left = y - plane @ np.linalg.lstsq(plane / root[:, None], y / root)[0]
    u = x / process.lengths
    kernel = np.exp(-0.5 * np.sum((u[:, None] - u) ** 2, axis=2))
    noise = np.diag(process.noise) / process.amplitude**2
    assert process.amplitude**2 == pytest.approx(left @ np.linalg.solve(kernel + noise, left) / 50, rel=1e-6)
    np.testing.assert_allclose(process.noise / variance, process.noise[0] / variance[0])
