from collections.abc import Callable

import numpy as np
import pytest

from surrogate.forward_map import forward_map
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.single_frame import branches, diameter_profile
from surrogate.single_frame.posterior import posterior_of
from touchcal.arrays import Array


def two_loads(u: Array) -> tuple[Array, Array]:
    """Residuals of touches (n, 4) that are 0 on two loads of each diameter, log d + 1 and log d + 3, of slopes 20."""
    load = u[:, 3] - u[:, 2]
    left = np.column_stack([9 * (u[:, 0] - u[:, 2]), 9 * u[:, 1], 10 * (load - 1) * (load - 3)])
    slope = np.zeros((len(u), 3, 4))
    slope[:, 0, 0], slope[:, 0, 2], slope[:, 1, 1] = 9, -9, 9
    slope[:, 2, 3], slope[:, 2, 2] = 20 * (load - 2), -20 * (load - 2)
    return left, slope


def test_branches_are_drawn_by_their_probabilities() -> None:
    """A prior of exp(-load / 2) leaves the heavier of two like branches 1 / (1 + e) of the draws."""
    args = (lambda d: (0 * d, 0 * d + 5.3), lambda u: u)
    ridge = diameter_profile.find(two_loads, np.zeros(4), (-0.5, 0.5), *args)
    found = branches.find(two_loads, ridge, *args)
    assert found.several
    drawn = branches.draws(found, lambda u: two_loads(u)[0],
                           lambda u: np.where(np.abs(u[:, 2]) < 0.5, (u[:, 2] - u[:, 3]) / 2, -np.inf),
                           np.random.default_rng(0))
    load, log_d = drawn.touch[:, 3] - drawn.touch[:, 2], drawn.touch[:, 2]
    assert np.sum(drawn.weight[load > 2]) == pytest.approx(1 / (1 + np.e), abs=0.02)
    assert drawn.weight @ log_d == pytest.approx(0.0, abs=0.02)
    assert np.sqrt(drawn.weight @ log_d**2) == pytest.approx(1 / np.sqrt(12), rel=0.03)
    assert np.sqrt(drawn.weight @ drawn.touch[:, 1] ** 2) == pytest.approx(1 / 9, rel=0.05)
    assert drawn.effective > 2000


def test_a_diameter_with_one_load_each_has_one_branch() -> None:
    def one_load(u: Array) -> tuple[Array, Array]:
        left, slope = two_loads(u)
        return np.column_stack([left[:, :2], 10 * (u[:, 3] - u[:, 2] - 1)]), np.concatenate(
            [slope[:, :2], np.broadcast_to(np.array([[[0.0, 0.0, -10.0, 10.0]]]), (len(u), 1, 4))], axis=1)

    args = (lambda d: (0 * d, 0 * d + 5.3), lambda u: u)
    ridge = diameter_profile.find(one_load, np.zeros(4), (-0.5, 0.5), *args)
    assert not branches.find(one_load, ridge, *args).several


def test_a_posterior_has_the_forces_on_both_sides_of_the_largest_signal(
        ring: forward_map.Ring, synthetic: Callable[..., tuple[Array, Array]]) -> None:
    """Signals that are largest at 0.06 N/mm d and there in proportion to d^2, and a touch far past that."""
    def peaked(touch: Array, signal: Array) -> Array:
        load = touch[:, 3] / (0.06 * touch[:, 2])
        size = 1e-3 * (touch[:, 2] / 10) ** 2 * load * np.exp(1 - load)
        return signal * (size / np.linalg.norm(signal, axis=1))[:, None]

    touch, signal = synthetic(120, 0, reach_mm=39.0)
    learned = forward_map.fit(ring, touch, peaked(touch, signal))
    truth = to_unknown(np.array([[-33.0, 15.0, 10.0, 1.6]]), learned.p0)
    level, noise = forward_map.linearise(learned, truth).signal_V[0], 1e-5
    found = posterior_of(learned, level + noise * np.random.default_rng(1).normal(size=len(level)), noise)
    assert 0.2 < np.mean(found.draws[:, 3] < 0.6) < 0.5
    assert np.quantile(found.draws[:, 3], 0.95) > 1.9
    assert found.effective > 1000
