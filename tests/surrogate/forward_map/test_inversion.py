from collections.abc import Callable

import numpy as np
import pytest

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map
from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import light_pressure, to_touch, to_unknown, touch_slope
from touchcal.arrays import Array

Synthetic = Callable[..., tuple[Array, Array]]
QUIET_V = 2e-5  # 100 dB below the baseline of about 2 V


@pytest.fixture(scope="module")
def learned(ring: Ring, synthetic: Synthetic) -> ForwardMap:
    return forward_map.fit(ring, *synthetic(140, 0))


def test_unseen_signals_are_reproduced(learned: ForwardMap, synthetic: Synthetic) -> None:
    touch, signal = synthetic(200, 1)
    error = linearise(learned, to_unknown(touch, learned.p0)).signal_V - signal
    relative = np.linalg.norm(error, axis=1) / np.linalg.norm(signal, axis=1)
    print("relative error of the forward map: median", np.median(relative), "largest", relative.max())
    assert np.median(relative) < 2e-4
    assert relative.max() < 5e-3


def test_forty_scenes_give_a_useful_map(ring: Ring, synthetic: Synthetic) -> None:
    few = forward_map.fit(ring, *synthetic(40, 2))
    touch, signal = synthetic(100, 1)
    error = linearise(few, to_unknown(touch, few.p0)).signal_V - signal
    assert np.median(np.linalg.norm(error, axis=1) / np.linalg.norm(signal, axis=1)) < 3e-3


@pytest.mark.slow
def test_a_few_diameters_teach_those_between(ring: Ring, synthetic: Synthetic) -> None:
    few = forward_map.fit(ring, *synthetic(140, 0, (10, 12, 14, 16, 18)))
    touch, signal = synthetic(100, 1)
    error = np.abs(invert(few, signal).touch - touch)
    assert np.all(np.quantile(error, 0.9, axis=0) < [0.01, 0.01, 0.3, 0.03])


def test_coordinates_of_a_punch_and_back(synthetic: Synthetic) -> None:
    touch = synthetic(20, 0)[0]
    p0 = light_pressure(touch)
    unknown = to_unknown(touch, p0)
    assert np.allclose(to_touch(unknown, p0), touch)
    for q, h in enumerate(1e-6 * np.eye(4)):
        change = (to_touch(unknown + h, p0) - to_touch(unknown - h, p0)) / 2e-6
        assert np.allclose(touch_slope(unknown, p0)[:, :, q], change, rtol=1e-7, atol=1e-7)


def test_jacobian_equals_finite_differences(learned: ForwardMap, synthetic: Synthetic) -> None:
    unknown = to_unknown(synthetic(5, 3)[0], learned.p0)
    jacobian = linearise(learned, unknown).jacobian
    for q, h in enumerate(np.diag(1e-5 * learned.sd)):
        change = (linearise(learned, unknown + h).signal_V - linearise(learned, unknown - h).signal_V) / (2 * h[q])
        assert np.allclose(jacobian[..., q], change, atol=1e-5 * np.abs(change).max())


@pytest.mark.slow
def test_touches_are_recovered_without_noise(learned: ForwardMap, synthetic: Synthetic) -> None:
    touch, signal = synthetic(150, 1)
    error = np.abs(invert(learned, signal).touch - touch)
    print("median and 95 % errors of x, y, d, F:", np.median(error, axis=0), np.quantile(error, 0.95, axis=0))
    assert np.all(np.median(error, axis=0) < [0.002, 0.002, 0.05, 0.005])
    assert np.all(np.quantile(error, 0.95, axis=0) < [0.01, 0.01, 0.3, 0.03])


@pytest.mark.slow
def test_covariance_is_calibrated_under_noise(learned: ForwardMap, synthetic: Synthetic) -> None:
    touch, signal = synthetic(400, 1)
    found = invert(learned, signal + QUIET_V * np.random.default_rng(5).normal(size=signal.shape), QUIET_V)
    z = (found.touch - touch) / np.sqrt(np.einsum("npp->np", found.covariance))
    print("mean square of error over sd:", np.mean(z**2, axis=0), "broad posteriors:", found.broad.mean())
    assert np.all(np.abs(np.mean(np.abs(z) < 1.645, axis=0)[:2] - 0.9) < 0.05)
    assert np.all(np.abs(np.mean(z**2, axis=0) - 1.0) < 0.3)
    assert np.median(found.misfit) == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_unknown_noise_widens_the_covariance(learned: ForwardMap, synthetic: Synthetic) -> None:
    touch, signal = synthetic(50, 1)
    noisy = signal + QUIET_V * np.random.default_rng(5).normal(size=signal.shape)
    found = invert(learned, noisy)
    assert np.all(found.misfit > 3)
    sd = np.sqrt(np.einsum("npp->np", found.covariance))[:, :2]
    assert np.all(np.mean(np.abs(found.touch - touch)[:, :2] < 1.645 * sd, axis=0) > 0.7)


@pytest.mark.thorough
def test_a_frame_does_not_depend_on_its_company(learned: ForwardMap, synthetic: Synthetic) -> None:
    _, signal = synthetic(3, 4)
    together = invert(learned, signal, QUIET_V).touch
    alone = np.concatenate([invert(learned, frame[None], QUIET_V).touch for frame in signal])
    assert np.allclose(together, alone, rtol=1e-6)


def test_a_touch_outside_the_training_is_told(learned: ForwardMap, synthetic: Synthetic, ring: Ring) -> None:
    inner, signal = synthetic(120, 0)
    kept = np.hypot(inner[:, 0], inner[:, 1]) < 45
    few = forward_map.fit(ring, inner[kept], signal[kept])
    outside = invert(few, signal[~kept], QUIET_V)
    radius = np.hypot(inner[~kept, 0], inner[~kept, 1])
    near = radius < 50
    assert not np.any(outside.inside[radius > 47])
    assert np.all(np.hypot(*(outside.touch - inner[~kept])[near, :2].T) < 3)


def test_what_it_cannot_learn_is_refused(ring: Ring, synthetic: Synthetic) -> None:
    touch, signal = synthetic(40, 0)
    with pytest.raises(ValueError, match="10 training rows are too few"):
        forward_map.fit(ring, touch[:10], signal[:10])


@pytest.mark.thorough
@pytest.mark.parametrize("noise_V", [1e-300, 1.0, 1000.0])
def test_noise_without_a_meaning_costs_no_answer(learned: ForwardMap, synthetic: Synthetic, noise_V: float) -> None:
    """Least of all an error or a warning of singular equations."""
    found = invert(learned, synthetic(3, 5)[1], noise_V)
    assert np.isfinite(found.touch).all()
    assert np.isfinite(found.covariance).all()
