from __future__ import annotations

from functools import partial

import numpy as np
import pytest

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
    assert np.sqrt(np.mean((gaussian_process.mean(process, at)[0] - surface(at)) ** 2)) < 1.5 * noise


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
        change = gaussian_process.mean(process, at + h)[0] - gaussian_process.mean(process, at - h)[0]
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
    error = [np.sqrt(np.mean((gaussian_process.mean(gaussian_process.fit(x, y, v), at)[0] - surface(at)) ** 2))
             for v in (None, sd**2)]
    assert error[1] < 0.05 * error[0]


def test_a_constant_input_is_harmless() -> None:
    x = points(40, 0)
    x[:, 2] = 7.0
    process = gaussian_process.fit(x, surface(x))
    assert np.allclose(gaussian_process.mean(process, x)[0], surface(x), atol=1e-3)


def test_too_few_rows_are_refused() -> None:
    with pytest.raises(ValueError, match="4 rows are too few to learn from 3 inputs"):
        gaussian_process.fit(points(4, 0), np.arange(4.0))
