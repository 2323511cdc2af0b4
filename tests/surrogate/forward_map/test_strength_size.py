import numpy as np

from surrogate.forward_map import simulator_error, strength_size


def test_sizes_of_a_quadratic_come_back_with_their_gradient() -> None:
    x = np.random.default_rng(0).normal(size=(400, 3))

    def log_size(at: np.ndarray) -> np.ndarray:
        return -5 + 0.3 * at[:, 0] - 0.7 * at[:, 1] + 0.1 * at[:, 2] + 0.2 * at[:, 1] ** 2 - 0.1 * at[:, 0] * at[:, 1]

    found = strength_size.fit(x, np.exp(log_size(x)))
    at, gradient = strength_size.at(found, x[:5])
    np.testing.assert_allclose(np.log(at), log_size(x[:5]), atol=1e-4)
    for q, h in enumerate(1e-5 * np.eye(3)):
        change = np.log(strength_size.at(found, x[:5] + h)[0] / strength_size.at(found, x[:5] - h)[0]) / 2e-5
        np.testing.assert_allclose(gradient[:, q], change, atol=1e-8)


def test_inputs_that_differ_by_rounding_move_no_size() -> None:
    rng = np.random.default_rng(1)
    x = np.column_stack([2.5 + 1e-6 * rng.normal(size=100), rng.normal(size=100)])
    found = strength_size.fit(x, np.exp(x[:, 1] + 0.1 * rng.normal(size=100)))
    assert np.max(np.abs(strength_size.at(found, x)[1][:, 0])) < 1e-2


def test_what_the_simulator_states_is_kept_by_the_gap() -> None:
    gap = np.random.default_rng(2).uniform(0, 1, 2000)
    found = simulator_error.learned_from(gap, 0.2 * np.exp(-4 * gap))
    asked = np.array([0.1, 0.5, 0.9])
    np.testing.assert_allclose(simulator_error.at(found, asked), 0.2 * np.exp(-4 * asked), rtol=0.03)
    few = simulator_error.learned_from(gap[:20], np.full(20, 0.01))
    np.testing.assert_allclose(simulator_error.at(few, asked), 0.01)
