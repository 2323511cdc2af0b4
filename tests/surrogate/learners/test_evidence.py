import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from surrogate.learners.bayesian_network import bayesian_regularisation, laplace, layer
from surrogate.learners.bayesian_network.bayesian_regularisation import Options
from touchcal.arrays import Array


def curve(rows: int, noise: float, seed: int = 0) -> tuple[Array, Array]:
    """A smooth curve of two inputs with white noise."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (rows, 2))
    return x, 0.6 * np.sin(2.5 * x[:, 0]) * x[:, 1] + noise * rng.normal(size=rows)


def test_it_finds_the_noise_and_few_effective_parameters() -> None:
    x, y = curve(400, 0.05)
    weights, trained = bayesian_regularisation.train(x, y, 1, Options(units=15, epochs=150))
    assert math.sqrt(0.5 / trained.beta) == pytest.approx(0.05, rel=0.1)
    assert 8 < trained.gamma < 0.75 * len(weights)
    clean_x, clean_y = curve(500, 0.0, seed=9)
    error = layer.output(weights, clean_x) - clean_y
    assert np.sqrt(np.mean(error**2)) < 0.02


def test_its_intervals_hold_the_truth() -> None:
    x, y = curve(150, 0.05)
    weights, trained = bayesian_regularisation.train(x, y, 1, Options(units=10, epochs=150))
    at, truth = curve(2000, 0.05, seed=9)
    drawn = laplace.draws(weights, x, trained.alpha, trained.beta, 200, np.random.default_rng(0))
    variance = np.mean((layer.jacobian(weights, at) @ drawn.T) ** 2, axis=1) + 0.5 / trained.beta
    inside = np.abs(layer.output(weights, at) - truth) < 1.645 * np.sqrt(variance)
    assert inside.mean() == pytest.approx(0.90, abs=0.03)


@pytest.mark.parametrize("rows", [30, 120], ids=["fewer rows than weights", "more rows than weights"])
def test_both_systems_give_the_same_numbers(rows: int) -> None:
    x, y = curve(rows, 0.1)
    w = layer.initial_weights(2, 15, np.random.default_rng(2))
    alpha, beta, mu = 0.3, 7.0, 0.02
    j, eye = layer.jacobian(w, x), np.eye(len(w))
    hessian = beta * j.T @ j + alpha * eye
    error = layer.output(w, x) - y
    step = -np.linalg.solve(hessian + mu * eye, beta * j.T @ error + alpha * w)
    state = bayesian_regularisation._State(w, alpha, beta, error)
    of, gradient = laplace.curvature(w, x), beta * j.T @ error + alpha * w
    assert np.allclose(bayesian_regularisation._damped_step(x, state, of, gradient)(mu), step, rtol=1e-7, atol=1e-10)
    gamma, left = laplace.effective_parameters(of, alpha, beta)
    assert gamma == pytest.approx(len(w) - alpha * float(np.trace(np.linalg.inv(hessian))), rel=1e-9)
    assert left == pytest.approx(rows - gamma, rel=1e-9)
    expected = -state.cost - 0.5 * float(np.linalg.slogdet(hessian)[1]) + 0.5 * len(w) * math.log(alpha) \
        + 0.5 * rows * math.log(beta)
    assert laplace.log_evidence(of, alpha, beta, state.cost) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("rows", [30, 120], ids=["fewer rows than weights", "more rows than weights"])
def test_draws_have_the_laplace_covariance(rows: int) -> None:
    """Within four standard errors of a sample variance, for the outputs at the rows."""
    x, _ = curve(rows, 0.1)
    w = layer.initial_weights(2, 15, np.random.default_rng(2))
    j, count = layer.jacobian(w, x), 4000
    exact = 0.5 * (j @ np.linalg.inv(7.0 * j.T @ j + 0.3 * np.eye(len(w))) * j).sum(axis=1)
    drawn = np.mean((j @ laplace.draws(w, x, 0.3, 7.0, count, np.random.default_rng(1)).T) ** 2, axis=1)
    assert np.abs(drawn / exact - 1).max() < 4 * math.sqrt(2 / count)


def test_turned_inputs_and_idle_ones_leave_the_training_as_it_is() -> None:
    """Copies of an input, a constant 0 and a repeated row change neither the row space nor the step."""
    x, y = curve(40, 0.05)
    wide = np.hstack([x, x[:, :1], np.zeros((40, 2))])
    axes = bayesian_regularisation._directions(wide)
    assert axes.shape == (5, 2)
    assert np.allclose(wide @ axes @ axes.T, wide, atol=1e-12)
    w = layer.initial_weights(5, 4, np.random.default_rng(0))
    inside = layer.turned(layer.turned(w, axes), axes.T)
    assert np.allclose(layer.output(w, wide), layer.output(layer.turned(w, axes), wide @ axes), atol=1e-12)
    assert np.allclose(layer.output(w, wide), layer.output(inside, wide), atol=1e-12)
    weights, trained = bayesian_regularisation.train(wide, y, 0, Options(units=4, epochs=20))
    assert np.abs(layer.layers(weights, 5).inner[:, 3:]).max() < 1e-12
    assert trained.history[-1, 1] == pytest.approx(weights @ weights)


@pytest.mark.parametrize("rows", [3, 40], ids=["fewer rows than weights", "more rows than weights"])
def test_a_linear_gaussian_model_has_its_exact_evidence(rows: int) -> None:
    """With every weight but the offset at 0 the network is y = c + noise, whose evidence is a normal density."""
    x, y = curve(rows, 0.3)
    alpha, beta = 0.4, 5.0
    w = np.zeros(3 * (2 + 2) + 1)
    w[-1] = beta * y.sum() / (beta * rows + alpha)
    covariance = np.ones((rows, rows)) / (2 * alpha) + np.eye(rows) / (2 * beta)
    exact = multivariate_normal(np.zeros(rows), covariance).logpdf(y)
    state = bayesian_regularisation._State(w, alpha, beta, layer.output(w, x) - y)
    of = laplace.curvature(w, x)
    found = laplace.log_evidence(of, alpha, beta, state.cost) - 0.5 * rows * math.log(math.pi)
    assert found == pytest.approx(float(exact), rel=1e-10)
    assert laplace.effective_parameters(of, alpha, beta)[0] == pytest.approx(beta * rows / (beta * rows + alpha))


def test_alpha_and_beta_satisfy_their_equations_at_the_end() -> None:
    x, y = curve(60, 0.05)
    _, trained = bayesian_regularisation.train(x, y, 1, Options(units=8, epochs=400))
    squared_error, squared_weights, gamma = trained.history[-1, :3].tolist()
    assert trained.alpha == pytest.approx(gamma / (2 * squared_weights), rel=1e-6)
    assert trained.beta == pytest.approx((60 - gamma) / (2 * squared_error), rel=1e-6)


def test_a_target_that_the_inputs_do_not_hold_collapses_and_says_so() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-1, 1, (300, 3)), rng.uniform(-1, 1, 300)
    weights, trained = bayesian_regularisation.train(x, y, 0, Options(units=4, epochs=200, restarts=2))
    assert trained.collapsed
    assert trained.collapses == 3
    assert not np.isnan(trained.history).any()
    warm = bayesian_regularisation.train(x, y, 0, Options(units=4, epochs=30, restarts=1, warm_up=7))[1]
    assert np.isnan(warm.history[:, 2]).sum() == (7 if warm.collapses else 0)
    assert trained.gamma < 5
    assert np.abs(layer.output(weights, x) - y.mean()).max() < 0.4


def test_one_seed_gives_one_network() -> None:
    x, y = curve(40, 0.05)
    first, again, other = (
        bayesian_regularisation.train(x, y, seed, Options(units=5, epochs=30))[0] for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
