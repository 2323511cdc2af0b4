from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import electrode_correction, forward_map, multipole_series, rim_correction
from surrogate.forward_map.inversion import reading_covariance
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.forward_map.ring_symmetry import fold, symmetry_of
from surrogate.statistics import matern_process
from touchcal.arrays import Array

Synthetic = Callable[..., tuple[Array, Array]]


def test_every_map_of_the_ring_carries_touches_and_readings_alike(ring: Ring) -> None:
    """Turned and mirrored places of one dipole have the readings that the maps foretell."""
    symmetry = symmetry_of(ring)
    assert (len(symmetry.turn), int(symmetry.mirrored.sum())) == (32, 16)
    z = np.array([0.5 + 0.2j])
    images = symmetry.turn * np.where(symmetry.mirrored, z.conj(), z)
    here, there = (
        multipole_series.basis(*multipole_series.patterns(ring, ring.modes, at, 1))[..., 0] for at in (z, images)
    )
    assert np.allclose(symmetry.readings @ here[0], there, atol=1e-10 * np.abs(there).max())
    assert not np.allclose(here[0], there[1], atol=0.1 * np.abs(there).max())


def test_places_fold_into_one_half_sector(ring: Ring) -> None:
    rng = np.random.default_rng(0)
    z = np.sqrt(rng.random(200)) * np.exp(2j * np.pi * rng.random(200))
    place, _ = fold(symmetry_of(ring), z)
    assert np.allclose(np.abs(place), np.abs(z))
    assert np.all((np.angle(place) > -1e-9) & (np.angle(place) < np.pi / 16 + 1e-9))


def test_a_process_of_two_quantities_has_its_gradient() -> None:
    x = np.random.default_rng(1).random((120, 2))
    process = matern_process.fit(x, np.column_stack([np.sin(3 * x[:, 0]), x[:, 1] ** 2]))
    at = np.array([[0.4, 0.6], [0.2, 0.3]])
    mean, gradient = matern_process.predict(process, at)
    assert np.allclose(mean, np.column_stack([np.sin(3 * at[:, 0]), at[:, 1] ** 2]), atol=2e-3)
    for j, h in enumerate(1e-6 * np.eye(2)):
        change = (matern_process.predict(process, at + h)[0] - matern_process.predict(process, at - h)[0]) / 2e-6
        assert np.allclose(gradient[..., j], change, atol=1e-6)


@pytest.fixture(scope="module")
def whole(ring: Ring, synthetic: Synthetic) -> forward_map.ForwardMap:
    return forward_map.fit(ring, *synthetic(300, 0, (), 85.0))


@pytest.mark.thorough
def test_the_rim_effect_improves_the_map_near_the_rim(whole: forward_map.ForwardMap, ring: Ring,
                                                      synthetic: Synthetic) -> None:
    touch, signal = synthetic(100, 1, (), 85.0)
    near = np.hypot(touch[:, 0], touch[:, 1]) > 70
    unknown = to_unknown(touch, whole.p0)[near]
    series = replace(whole, correction=replace(whole.correction, rim=electrode_correction.zero_correction(ring)))
    left = [np.median(np.linalg.norm(forward_map.linearise(one, unknown).signal_V - signal[near], axis=1)
                      / np.linalg.norm(signal[near], axis=1)) for one in (series, whole)]
    print("relative error of series, and with the effect of the rim:", left)
    assert left[1] < left[0] / 4


def test_its_jacobian_equals_finite_differences(whole: forward_map.ForwardMap) -> None:
    touch = np.array([[60.0, 40.0, 12.0, 0.7], [-40.0, 72.0, 16.0, 1.5], [-30.0, -48.0, 14.0, 0.4]])
    unknown = to_unknown(touch, whole.p0)
    jacobian = forward_map.linearise(whole, unknown).jacobian
    for q, h in enumerate(np.diag(1e-5 * whole.sd)):
        ends = [forward_map.linearise(whole, unknown + s * h).signal_V for s in (1, -1)]
        change = (ends[0] - ends[1]) / (2 * h[q])
        assert np.allclose(jacobian[..., q], change, atol=1e-4 * np.abs(change).max())


def test_touches_near_the_rim_are_told_to_err_more_and_alike(whole: forward_map.ForwardMap) -> None:
    unknown = to_unknown(np.array([[5.0, 3.0, 14.0, 1.0], [80.0, 10.0, 14.0, 1.0]]), whole.p0)
    no_drift = reading_covariance.no_drift(len(whole.ring.read))
    told = reading_covariance.at(whole, unknown, np.ones(2), 0.0, no_drift)
    assert np.all(told.shrink[0] == 0)
    assert np.max(told.shrink[1]) > 0.5
    noisy = reading_covariance.at(whole, unknown, np.ones(2), 1.0, no_drift)
    assert noisy.white == pytest.approx([1.0, 1.0], rel=1e-3)
    assert np.max(noisy.shrink) < np.max(told.shrink)


@pytest.mark.slow
def test_copies_of_a_touch_do_not_tell_its_error(ring: Ring, synthetic: Synthetic) -> None:
    """Rows of the same touches, as a sweep with several cards has them: the error is that of touches left out."""
    touch, signal = synthetic(120, 4, (), 85.0)
    near = np.hypot(touch[:, 0], touch[:, 1]) > 40
    touch, signal = touch[near], signal[near]
    once = forward_map.fit(ring, touch, signal).correction.error.error
    twice = forward_map.fit(ring, np.repeat(touch, 2, axis=0), np.repeat(signal, 2, axis=0)).correction.error.error
    assert np.median(twice) > np.median(once) / 3


def test_touches_far_from_the_rim_and_few_readings_are_learned(ring: Ring, synthetic: Synthetic) -> None:
    touch, signal = synthetic(40, 5, (), 30.0)
    learned = forward_map.fit(ring, touch, signal)
    assert not electrode_correction.teaches(learned.correction.rim)
    assert np.all(np.isfinite(forward_map.linearise(learned, to_unknown(touch, learned.p0)).signal_V))


@pytest.mark.slow
def test_diameters_that_differ_by_rounding_are_learned_as_one(ring: Ring, synthetic: Synthetic) -> None:
    touch, signal = synthetic(140, 6, (12.0,), 85.0)
    jittered = touch.copy()
    jittered[:, 2] *= 1 + 1e-6 * np.random.default_rng(0).normal(size=len(touch))
    asked, expected = synthetic(40, 7, (12.0,), 85.0)
    error = []
    for taught in (touch, jittered):
        learned = forward_map.fit(ring, taught, signal)
        found = forward_map.linearise(learned, to_unknown(asked, learned.p0)).signal_V
        error.append(np.median(np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)))
    assert error[1] == pytest.approx(error[0], rel=0.5)


@pytest.mark.slow
def test_the_whole_signal_is_learned_where_the_series_only_hides_it(ring: Ring, synthetic: Synthetic) -> None:
    """Of a series that is nearly right the rest is learned; of one that leaves more than there was, the signal."""
    touch, signal = synthetic(360, 0, (), 85.0)
    learned = forward_map.fit(ring, touch, signal)
    unknown = to_unknown(touch, learned.p0)
    z, size = forward_map.place(ring, unknown), forward_map.signal_size(learned, unknown)
    wild = size[:, None] * np.random.default_rng(0).normal(size=signal.shape)
    for left, replaces in ((1e-4 * signal, False), (wild, True)):
        rows = rim_correction.Rows(z, unknown[:, 2:], forward_map.gap(ring, unknown), left, size, size)
        assert rim_correction.fit(ring, learned.field, rows, signal, learned.zones)[0].replaces == replaces


@pytest.mark.slow
def test_derivatives_are_those_of_the_signal_where_the_whole_is_learned(
        whole: forward_map.ForwardMap, ring: Ring, synthetic: Synthetic, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a map that was made to learn the whole near the rim, by central differences."""
    sizes = iter([0.0, 1.0])
    monkeypatch.setattr(rim_correction, "_size", lambda _: next(sizes))
    learned = forward_map.fit(ring, *synthetic(360, 0, (), 85.0))
    assert (learned.correction.replaces, whole.correction.replaces) == (True, False)
    at = to_unknown(synthetic(60, 5, (), 85.0)[0], learned.p0)
    found = forward_map.linearise(learned, at)
    plain = forward_map.linearise(whole, at)
    assert np.linalg.norm(found.signal_V - plain.signal_V) > 1e-3 * np.linalg.norm(plain.signal_V)
    for number, step in enumerate((1e-3, 1e-3, 1e-5, 1e-5)):
        by = step * np.eye(4)[number]
        change = (forward_map.linearise(learned, at + by).signal_V
                  - forward_map.linearise(learned, at - by).signal_V) / (2 * step)
        missed = np.linalg.norm(found.jacobian[..., number] - change, axis=1) / np.linalg.norm(change, axis=1)
        assert missed.max() < 1e-4
