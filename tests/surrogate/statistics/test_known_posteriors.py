"""Processes and least squares against dense formulas written out here."""

import numpy as np
import pytest

from surrogate.statistics import coefficient_process, gaussian_process, levenberg_marquardt, matern_process
from surrogate.statistics.gaussian_process import GaussianProcess


def _kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * np.sum((a[:, None] - b) ** 2, axis=2))


def _matern(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    t = np.sqrt(5) * np.linalg.norm(a[:, None] - b, axis=2)
    return (1 + t + t**2 / 3) * np.exp(-t)


def test_mean_and_variance_are_those_of_universal_kriging() -> None:
    """Rasmussen and Williams (2006), equations 2.41 and 2.42, with a vague linear trend."""
    rng = np.random.default_rng(0)
    x, y, at, noise = rng.random((15, 2)), rng.normal(size=15), rng.random((6, 2)), rng.uniform(0.01, 0.3, 15)
    centre, lengths, amplitude = np.array([0.4, 0.6]), np.array([0.5, 0.8]), 1.7
    process = GaussianProcess((x - centre) / lengths, centre, lengths, amplitude, noise, y)
    mean, _, variance = gaussian_process.predict(process, at)
    covariance = amplitude**2 * _kernel(x / lengths, x / lengths) + np.diag(noise)
    cross = amplitude**2 * _kernel(at / lengths, x / lengths)
    h, h_at = (np.column_stack([np.ones(len(p)), p - centre]) for p in (x, at))
    inverse = np.linalg.inv(covariance)
    spread = np.linalg.inv(h.T @ inverse @ h)
    trend = spread @ h.T @ inverse @ y
    unseen = h_at - cross @ inverse @ h
    assert mean == pytest.approx(h_at @ trend + cross @ inverse @ (y - h @ trend), rel=1e-8)
    assert variance == pytest.approx(amplitude**2 - np.sum((cross @ inverse) * cross, axis=1)
                                     + np.sum((unseen @ spread) * unseen, axis=1), rel=1e-7)
    assert gaussian_process.predict(process, at)[0] == pytest.approx(mean, rel=1e-12)


def test_rows_are_kept_evenly() -> None:
    assert gaussian_process.spread_evenly(9, 3).tolist() == [0, 4, 8]
    assert gaussian_process.spread_evenly(3, 9).tolist() == [0, 1, 2]


def test_evidence_is_the_likelihood_with_its_best_amplitude() -> None:
    """-n/2 log(y' C^-1 y) - log|C|/2 of each quantity, which is log N(y; 0, s^2 C) at its largest, but for a constant;
    so differences between inputs are those of the maxima found on a grid of s."""
    rng = np.random.default_rng(1)
    x, y = rng.random((12, 2)), rng.normal(size=(12, 2))

    def largest(inputs: np.ndarray, noise: float) -> float:
        covariance = _matern(inputs, inputs) + noise**2 * np.eye(12)
        quadratic, log_det = np.sum(y * np.linalg.solve(covariance, y), axis=0), np.linalg.slogdet(covariance)[1]
        log_s = np.linspace(-4, 4, 160001)[:, None]
        return float(np.sum(np.max(-0.5 * quadratic * np.exp(-2 * log_s) - 12 * log_s - 0.5 * log_det, axis=0)))

    gain = matern_process.log_evidence(2 * x, y, 0.1) - matern_process.log_evidence(x, y, 0.3)
    assert gain == pytest.approx(largest(2 * x, 0.1) - largest(x, 0.3), abs=1e-6)


def test_the_matern_process_is_its_formula_and_its_gradient_a_difference() -> None:
    rng = np.random.default_rng(2)
    x, at = rng.random((80, 2)) * [1, 50], rng.random((5, 2)) * [1, 50]
    y = np.column_stack([np.sin(3 * x[:, 0]), x[:, 0] + np.cos(0.05 * x[:, 1])])
    process = matern_process.fit(x, y)
    mean, gradient = matern_process.predict(process, at)
    assert mean == pytest.approx(_matern(at / process.lengths, x / process.lengths) @ process.weights, rel=1e-8)
    for q, h in enumerate((1e-5, 1e-3)):
        high, low = (matern_process.predict(process, at + sign * h * np.eye(2)[q])[0] for sign in (1, -1))
        assert gradient[:, :, q] == pytest.approx((high - low) / (2 * h), abs=2e-5)
    assert mean == pytest.approx(np.column_stack([np.sin(3 * at[:, 0]), at[:, 0] + np.cos(0.05 * at[:, 1])]), abs=0.02)


def test_the_matern_likelihood_gradient_is_a_difference() -> None:
    rng = np.random.default_rng(3)
    x, y, log = rng.random((20, 2)), rng.normal(size=(20, 3)), np.array([0.2, -0.3, -1.0])
    slope = matern_process._likelihood_and_gradient(log, x, y)[1]
    ends = [[matern_process._likelihood_and_gradient(log + s * h, x, y)[0] for s in (1, -1)] for h in 1e-5 * np.eye(3)]
    assert slope == pytest.approx([(high - low) / 2e-5 for high, low in ends], rel=1e-5)


def _rows(n: int, noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places, designs, true coefficients and readings of six each."""
    rng = np.random.default_rng(4)
    x, design = rng.random((n, 2)) * [1, 10], rng.normal(size=(n, 6, 2))
    truth = np.column_stack([1 + np.sin(2 * x[:, 0]), 0.3 * x[:, 1] + x[:, 0] ** 2])
    return x, design, truth, np.einsum("nrc,nc->nr", design, truth) + noise * rng.normal(size=(n, 6))


def test_shared_coefficients_come_back_with_their_gradient() -> None:
    x, design, truth, y = _rows(150, 1e-3)
    process = coefficient_process.fit(x, design, y, np.array([0.7, 7.0]), x[:, 1])
    found, gradient = coefficient_process.predict(process, x)
    assert found == pytest.approx(truth, abs=5e-3)
    u, nodes = (x - x.mean(axis=0)) / [0.7, 7.0], process.nodes
    assert found == pytest.approx(np.column_stack([np.ones(150), u, _kernel(u, nodes)]) @ process.weights, abs=1e-8)
    for q, h in enumerate((1e-5, 1e-4)):
        high, low = (coefficient_process.predict(process, x + sign * h * np.eye(2)[q])[0] for sign in (1, -1))
        assert gradient[:, :, q] == pytest.approx((high - low) / (2 * h), abs=1e-4)


def test_the_posterior_of_weights_is_the_ridge_solution() -> None:
    """(A' W A + S^-2)^-1 A' W y with A the designs times the regressors, and the diagonal of that inverse."""
    rng = np.random.default_rng(5)
    regressors, design, y = rng.normal(size=(12, 3)), rng.normal(size=(12, 4, 2)), rng.normal(size=(12, 4))
    weight, amplitude = rng.uniform(1, 3, 12), np.array([0.5, 2.0])
    whole = np.einsum("nrc,nq->nrcq", design, regressors).reshape(48, 6)
    normal = whole.T @ (np.repeat(weight, 4)[:, None] * whole) + np.diag(np.repeat(amplitude**-2, 3))
    expected = np.linalg.solve(normal, whole.T @ (np.repeat(weight, 4) * y.ravel()))
    mean, variance = coefficient_process._posterior(
        regressors, design.transpose(0, 2, 1) @ design, np.einsum("nrc,nr->nc", design, y), weight, amplitude, True)
    assert mean == pytest.approx(expected.reshape(2, 3).T, rel=1e-9)
    assert variance == pytest.approx(np.diag(np.linalg.inv(normal)).reshape(2, 3).T, rel=1e-9)


def test_nodes_are_farthest_from_those_before_wherever_the_rows_lie() -> None:
    """From 0: 10, then 4 or 5 (4 is 4 from 0, 5 is 5 from both), then 2 of what is left."""
    u = np.array([[0.0], [2.0], [4.0], [5.0], [10.0], [10.0]])
    for shift in (0.0, 7.0, -100.0):
        assert (coefficient_process._spread(u + shift, 4) - shift)[:, 0] == pytest.approx([0, 10, 5, 2])
    assert len(coefficient_process._spread(u, 9)) == 5
    around = np.array([[0.0, 0.0], [-3.0, 0.0], [1.0, 1.0], [-3.0, 0.5]])
    assert coefficient_process._spread(around, 2).tolist() == [[0, 0], [-3, 0.5]]
    assert coefficient_process._spread(around, 3).tolist() == [[0, 0], [-3, 0.5], [1, 1]]


def test_noise_is_smoothed_over_bins_along_the_order() -> None:
    """Eight bins of ten: RMS 1 in the lower half, 3 in the upper one, linear between the middles of two bins."""
    order = np.arange(80.0)
    error = np.where(order < 40, 1.0, 3.0) * np.where(order % 2, 1, -1)
    found = coefficient_process._smoothed(error[::-1], order[::-1])
    assert found[::-1][:35] == pytest.approx(1.0)
    assert found[::-1][45:] == pytest.approx(3.0)
    assert found[::-1][[39, 40]] == pytest.approx([1.9, 2.1])
    assert coefficient_process._smoothed(0 * error, order) == pytest.approx(1e-6)


def _powers(state: np.ndarray, _: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (a^3 - 8, a + b - 5, 0.1 b^2) of states (a, b), with a least cost that is not 0."""
    a, b = state.T
    residual = np.column_stack([a**3 - 8, a + b - 5, 0.1 * b**2])
    zero, one = np.zeros_like(a), np.ones_like(a)
    return residual, np.stack([np.column_stack([3 * a**2, zero]), np.column_stack([one, one]),
                               np.column_stack([zero, 0.2 * b])], axis=1)


def test_levenberg_marquardt_ends_where_the_gradient_is_0() -> None:
    found = levenberg_marquardt.minimise(_powers, np.array([[1.0, 1.0], [4.0, 9.0]]), 60)
    residual, jacobian = _powers(found.state, np.arange(2))
    assert found.state[0] == pytest.approx(found.state[1], abs=2e-3)
    assert np.abs(np.einsum("nrp,nr->np", jacobian, residual)).max() < 0.02
    assert found.cost == pytest.approx(0.5 * np.sum(residual**2, axis=1))
    assert found.residual == pytest.approx(residual)
    assert found.normal == pytest.approx(np.einsum("nrp,nrq->npq", jacobian, jacobian))


def test_steps_that_raise_the_cost_are_not_taken() -> None:
    """Residual arctan(5 x) from x = 2, where the full step of Gauss and Newton goes to -145."""
    costs: list[float] = []

    def residuals(state: np.ndarray, _: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value = np.arctan(5 * state)
        costs.append(float(0.5 * np.sum(value**2)))
        return value, (5 / (1 + 25 * state**2))[:, :, None]

    found = levenberg_marquardt.minimise(residuals, np.array([[2.0]]), 200)
    assert max(costs) > costs[0]
    assert abs(found.state[0, 0]) < 0.01
    held = levenberg_marquardt.minimise(residuals, np.array([[2.0]]), 200, lambda state: np.maximum(state, 0.5))
    assert held.state[0, 0] == pytest.approx(0.5)


def test_starts_of_one_problem_that_meet_end_as_one() -> None:
    """Of four starts the first two and the last are of one problem; one of the first two is asked no more after they
    met, the last ends in another minimum."""
    asked: list[np.ndarray] = []

    def residuals(state: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(which)
        return 1e3 * (state**2 - 4), 2e3 * state[:, :, None]

    start = np.array([[3.0], [2.5], [2.6], [-1.0]])
    alone = levenberg_marquardt.minimise(residuals, start, 50)
    whole, _ = np.concatenate(asked), asked.clear()
    found = levenberg_marquardt.minimise(residuals, start, 50, problem=np.array([0, 0, 1, 0]))
    assert np.allclose(alone.state.ravel(), [2, 2, 2, -2], atol=1e-6)
    assert np.allclose(found.state, alone.state, atol=1e-6)
    assert found.state[0] == found.state[1] != found.state[2]
    counts = [np.bincount(which, minlength=4) for which in (whole, np.concatenate(asked))]
    assert counts[1][:2].sum() < counts[0][:2].sum()
    assert np.array_equal(counts[1][2:], counts[0][2:])


def test_starts_of_one_problem_that_coincide_go_on_as_one_from_the_first_step() -> None:
    asked: list[int] = []

    def residuals(state: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(len(which))
        return _powers(state, which)

    found = levenberg_marquardt.minimise(residuals, np.ones((4, 2)), 60, problem=np.zeros(4, np.intp))
    assert asked[0] == 4
    assert set(asked[1:]) == {1}
    assert np.ptp(found.state, axis=0) == pytest.approx(0.0, abs=0)


def test_no_problems_have_no_minima() -> None:
    found = levenberg_marquardt.minimise(_powers, np.zeros((0, 2)), 60, problem=np.zeros(0, np.intp))
    assert (found.state.shape, found.normal.shape, found.residual.shape) == ((0, 2), (0, 2, 2), (0, 3))


def test_a_damped_step_is_that_of_marquardt() -> None:
    """(J'J + d diag(J'J))^-1 J'r."""
    rng = np.random.default_rng(6)
    residual, jacobian, damping = rng.normal(size=(2, 4)), rng.normal(size=(2, 4, 3)), np.array([0.0, 0.7])
    turned = jacobian.transpose(0, 2, 1)
    steps = levenberg_marquardt._step((turned @ residual[..., None])[..., 0], turned @ jacobian, damping)
    for r, j, d, step in zip(residual, jacobian, damping, steps, strict=True):
        assert step == pytest.approx(np.linalg.solve(j.T @ j + d * np.diag(np.diag(j.T @ j)), j.T @ r))


def test_inverses_whatever_the_units() -> None:
    """[[a, b], [b, c]]^-1 = [[c, -b], [-b, a]]/(a c - b^2)."""
    for a, b, c in ((4e12, 1e3, 1e-6), (2.0, 0.5, 1.0)):
        found = levenberg_marquardt.inverse(np.array([[[a, b], [b, c]]]))[0]
        assert found == pytest.approx(np.array([[c, -b], [-b, a]]) / (a * c - b * b), rel=1e-9, abs=0)


def test_trials_are_those_of_marquardt() -> None:
    """One problem replayed by itself: damping from 1e-3, a tenth after a step that lowers the cost, ten times after one
    that does not, until a step gains less than 1e-5 of 1 + cost."""
    asked: list[float] = []

    def residuals(state: np.ndarray, _: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(float(state[0, 0]))
        return np.arctan(5 * state) + 0.3, (5 / (1 + 25 * state**2))[:, :, None]

    found = levenberg_marquardt.minimise(residuals, np.array([[0.5]]), 200)
    x, damping, trials = 0.5, 1e-3, [0.5]
    for _ in range(200):
        slope = 5 / (1 + 25 * x**2)
        trial = x - (np.arctan(5 * x) + 0.3) / (slope * (1 + damping))
        gain, cost = (0.5 * (np.arctan(5 * at) + 0.3) ** 2 for at in (x, trial))
        gain -= cost
        trials.append(float(trial))
        damping *= 0.1 if gain > 0 else 10.0
        x = trial if gain > 0 else x
        if 0 < gain < 1e-5 * (1 + cost):
            break
    assert asked == pytest.approx(trials, rel=1e-9)
    assert any(damped > 0.5 for damped in np.abs(np.diff(trials)))
    assert found.state[0, 0] == pytest.approx(x)


def test_the_regressors_are_the_prior_of_trend_and_process() -> None:
    """R R' = 10^2 (1 + u u') + K(u, nodes) K(nodes, nodes)^-1 K(nodes, u)."""
    rng = np.random.default_rng(9)
    u, nodes = rng.normal(size=(20, 2)), rng.normal(size=(12, 2))
    found = coefficient_process._regressors(u, nodes)
    cross = _kernel(u, nodes)
    inverse = np.linalg.inv(_kernel(nodes, nodes) + 1e-8 * np.eye(12))
    assert found @ found.T == pytest.approx(100 * (1 + u @ u.T) + cross @ inverse @ cross.T, rel=1e-6, abs=1e-6)
