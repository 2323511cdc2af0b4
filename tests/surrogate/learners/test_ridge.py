from collections.abc import Callable

import numpy as np
import pytest

from surrogate.learners import ridge, signal_features
from surrogate.learners.bayesian_network.min_max import min_max, scaled, unscaled
from touchcal.arrays import Array

Synthetic = Callable[[int, int], tuple[Array, Array]]


def test_whitened_features_have_unit_covariance(synthetic: Synthetic) -> None:
    _, signal = synthetic(100, 0)
    found = signal_features.features(signal_features.fit_directions(signal, 6), signal)
    assert np.allclose(np.cov(found[:, :6].T, bias=True), np.eye(6), atol=1e-9)
    assert np.allclose([found[:, 6].mean(), found[:, 6].std()], [0, 1])


def test_feature_slopes_equal_finite_differences(synthetic: Synthetic) -> None:
    _, signal = synthetic(30, 0)
    directions = signal_features.fit_directions(signal, 6)
    slopes = signal_features.by_signal(directions, signal[:2], np.broadcast_to(np.eye(7), (2, 7, 7)))
    h = 1e-7 * np.linalg.norm(signal[0])
    for k in (0, 50, 207):
        move = h * np.eye(208)[k]
        change = signal_features.features(directions, signal[:2] + move) - signal_features.features(
            directions, signal[:2] - move
        )
        assert np.allclose(slopes[..., k], change / (2 * h), rtol=1e-5, atol=1e-5 * np.abs(slopes).max())
    by = np.random.default_rng(0).normal(size=(2, 3, 7))
    assert np.allclose(signal_features.by_signal(directions, signal[:2], by), by @ slopes, rtol=1e-9)


def test_an_untouched_frame_has_no_features(synthetic: Synthetic) -> None:
    _, signal = synthetic(30, 0)
    with pytest.raises(ValueError, match="frame 1 equals the untouched one"):
        signal_features.features(signal_features.fit_directions(signal, 6), np.vstack([signal[0], np.zeros(208)]))


def test_leave_one_out_by_leverages_equals_leaving_out(synthetic: Synthetic) -> None:
    touch, signal = synthetic(30, 0)
    basis, y, penalty = ridge._basis(signal, 4), touch[:, 0], 0.01
    a = basis.left * basis.singular @ basis.right
    errors = []
    for i in range(30):
        kept = np.arange(30) != i
        inner = np.column_stack([np.ones(29), a[kept]])
        penalties = np.diag(np.r_[0.0, np.full(a.shape[1], penalty * 30)])
        w = np.linalg.solve(inner.T @ inner + penalties, inner.T @ y[kept])
        errors.append(y[i] - w[0] - a[i] @ w[1:])
    assert ridge._leave_one_out(basis, y, penalty) == pytest.approx(np.mean(np.square(errors)), rel=1e-8)


def test_places_are_read_from_two_hundred_touches(synthetic: Synthetic) -> None:
    touch, signal = synthetic(200, 0)
    learned = ridge.fit(signal, touch)
    touch, signal = synthetic(200, 1)
    error = learned.estimate(signal, 0.0).value - touch
    assert np.sqrt(np.mean(error[:, :2] ** 2)) < 1.0


def test_noise_is_carried_to_the_outputs(synthetic: Synthetic) -> None:
    touch, signal = synthetic(150, 0)
    learned, noise = ridge.fit(signal, touch[:, :1]), 1e-8
    frame = np.repeat(signal[5:6], 4000, axis=0)
    noisy = frame + noise * np.random.default_rng(0).normal(size=frame.shape)
    scatter = learned.estimate(noisy, 0.0).value.std()
    quiet, loud = (learned.estimate(signal[5:6], v).sd[0, 0] for v in (0.0, noise))
    assert np.sqrt(loud**2 - quiet**2) == pytest.approx(scatter, rel=0.05)


def test_min_max_maps_onto_minus_one_to_one_and_back() -> None:
    values = np.array([[1.0, 5.0], [3.0, 5.0], [2.0, 5.0]])
    scaling = min_max(values)
    assert scaled(scaling, values).tolist() == [[-1, 0], [1, 0], [0, 0]]
    assert np.array_equal(unscaled(scaling, scaled(scaling, values)), values)
