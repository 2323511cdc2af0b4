"""Touches whose dipole vanishes and changes its sign with the force, as a conducting punch in strained skin does."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.samples import SweepSamples, take
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map
from surrogate.forward_map.amplitude import amplitude
from surrogate.forward_map.forward_map import ForwardMap, linearise, signal_size, strength_covariance, strengths
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.model.model import Model
from surrogate.model.predict import predict, prepare
from surrogate.model.train import train
from touchcal.arrays import Array

Sum = Callable[..., tuple[Array, Array]]
ZERO_N = 0.9  # force at which the dipole of a 14 mm punch vanishes


@pytest.fixture(scope="module")
def summed(synthetic: Callable[..., tuple[Array, Array]], spots: Callable[..., Array]) -> Sum:
    """(count, seed) -> touches and signals of a spot of less conductance that grows with F in the skin about a contact
    of more, whose dipoles cancel near ZERO_N; d in steps of 2 mm."""
    def drawn(count: int, seed: int) -> tuple[Array, Array]:
        touch, _ = synthetic(count, seed, (10, 12, 14, 16, 18), 40.0)
        d, force = touch[:, 2:].T
        inner, outer = d / 2, 0.9 * d
        press = force / (ZERO_N * (d / 14) ** 1.5)
        contact = spots(touch, inner, 0.2 * press / (0.3 + press))
        around = spots(touch, outer, -0.2 * press * (inner / outer) ** 2 * (1 + 0.5 * (press - 1)) / (0.3 + press))
        return touch, contact + around
    return drawn


@pytest.fixture(scope="module")
def learned(ring: Ring, summed: Sum) -> ForwardMap:
    return forward_map.fit(ring, *summed(250, 0))


@pytest.mark.thorough
def test_signals_are_reproduced_where_the_dipole_has_either_sign_and_none(learned: ForwardMap, summed: Sum) -> None:
    """The error is part of the size of the signal, which does not vanish with the dipole."""
    touch, signal = summed(500, 1)
    unknown = to_unknown(touch, learned.p0)
    dipole = strengths(learned, unknown)[:, 0]
    size = signal_size(learned, unknown)
    assert min(np.mean(dipole > 0), np.mean(dipole < 0)) > 0.2
    error = np.linalg.norm(linearise(learned, unknown).signal_V - signal, axis=1) / size
    weak = np.linalg.norm(signal, axis=1) < 0.3 * size
    print("errors over the size, weak signals and all:", np.median(error[weak]), np.median(error))
    assert weak.sum() > 10
    assert np.median(error[weak]) < 2e-3
    assert np.median(error) < 2e-3


def test_the_error_of_strengths_does_not_vanish_with_the_dipole(learned: ForwardMap) -> None:
    force = np.linspace(0.5, 1.5, 40)
    unknown = to_unknown(np.column_stack([np.full((40, 2), 5.0), np.full(40, 14.0), force]), learned.p0)
    dipole = strengths(learned, unknown)[:, 0]
    sd = np.sqrt(strength_covariance(learned, unknown)[:, 0, 0])
    least = np.argmin(np.abs(dipole))
    assert dipole[0] * dipole[-1] < 0
    assert sd[least] > 0.5 * np.median(sd)


def test_the_jacobian_equals_finite_differences(learned: ForwardMap, summed: Sum) -> None:
    unknown = to_unknown(summed(5, 3)[0], learned.p0)
    jacobian = linearise(learned, unknown).jacobian
    for q, h in enumerate(np.diag(1e-5 * learned.sd)):
        change = (linearise(learned, unknown + h).signal_V - linearise(learned, unknown - h).signal_V) / (2 * h[q])
        assert np.allclose(jacobian[..., q], change, atol=1e-5 * np.abs(change).max())


def test_the_amplitude_has_its_first_top_before_it_vanishes(learned: ForwardMap) -> None:
    found = amplitude(learned)
    force = np.array(found["force_N"])
    middle = next(one for one in found["diameters"] if one["d_mm"] == 14)
    rms_V = np.array(middle["rms_V"])
    assert middle["peak_N"] is not None
    assert middle["peak_N"] < force[np.argmin(rms_V[20:]) + 20]
    low, high = middle["two_answers_N"]
    assert low < middle["peak_N"] < high


@pytest.fixture(scope="module")
def rows(samples: SweepSamples, summed: Sum) -> SweepSamples:
    touch, signal = summed(500, 5)
    more, scene = take(samples, np.arange(500) % len(samples)), np.arange(500)
    return replace(more, scene=scene, group=scene, row_hash=scene.astype(np.uint64),
                   target=np.column_stack([touch, more.target[:, 4:]]), signal_V=signal)


@pytest.mark.slow
def test_a_sweep_trains_reads_touches_better_than_ridge_and_its_intervals_hold(rows: SweepSamples, summed: Sum) -> None:
    def error(model: Model, touch: Array, signal: Array) -> tuple[Array, float]:
        found = predict(prepare(model, model.baseline_V), model.baseline_V + signal)
        off = found.value - touch
        held = np.mean((off <= found.below) & (-off <= found.above))
        return np.sqrt(np.mean(off**2, axis=0)), float(held)

    touch, signal = summed(150, 9)
    names = ("x0", "y0", "d", "F")
    forward, held = error(train(rows, "forward", names, 1), touch, signal)
    ridge, _ = error(train(rows, "ridge", names, 1), touch, signal)
    print("forward", forward, "ridge", ridge, "held", held)
    assert np.all(forward < 0.5 * ridge)
    assert held > 0.85
