"""Several touches read from one frame."""

from collections.abc import Callable

import numpy as np
import pytest

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map.forward_map import ForwardMap, fit, linearise
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.forward_map.scattering import scattered
from surrogate.single_frame.several_at_once import Several, number, read_several
from touchcal.arrays import Array

NOISE_V = 2e-4


@pytest.fixture(scope="module")
def forward(ring: Ring, synthetic: Callable[..., tuple[Array, Array]]) -> ForwardMap:
    return fit(ring, *synthetic(120, 1))


def read(forward: ForwardMap, touches: Array, seed: int = 0, most: int = 3) -> tuple[Several, ...]:
    clean = linearise(forward, to_unknown(touches, forward.p0)).signal_V.sum(axis=0)
    frame = clean + NOISE_V * np.random.default_rng(seed).normal(size=clean.size)
    alone = invert(forward, frame[None], NOISE_V).touch
    return read_several(forward, frame, NOISE_V, to_unknown(alone, forward.p0)[0], most)


@pytest.mark.thorough
def test_two_touches_are_found_in_either_order(forward: ForwardMap) -> None:
    both = np.array([[-30.0, 12.0, 14.0, 1.2], [28.0, -20.0, 12.0, 0.8]])
    found, turned = read(forward, both), read(forward, both[::-1])
    assert number(found) == 2
    assert not found[1].too_near
    assert np.all(np.hypot(*(found[1].touch - both)[:, :2].T) < 2.0)
    assert turned[1].touch == pytest.approx(found[1].touch, abs=1e-6)


def test_three_touches_are_counted_and_read(forward: ForwardMap) -> None:
    three = np.array([[-30.0, 12.0, 14.0, 1.2], [0.0, 25.0, 14.0, 1.0], [28.0, -20.0, 12.0, 0.8]])
    found = read(forward, three, most=4)
    assert number(found) == 3
    assert np.all(np.hypot(*(found[2].touch - three)[:, :2].T) < 2.5)
    assert np.all(np.abs((found[2].touch - three).ravel()) < 4 * np.sqrt(np.diag(found[2].covariance)))


def test_one_touch_is_not_split_in_two(forward: ForwardMap) -> None:
    assert all(number(read(forward, np.array([[15.0, -25.0, 14.0, 1.0]]), seed)) == 1 for seed in range(3))


def test_a_touch_scatters_the_field_of_another_as_a_dipole_in_a_large_disc(ring: Ring) -> None:
    """Two dipoles p near the middle of a disc and d from each other, along and across a uniform field: their sum
    changes by p / d^2, less along it and more across it, as far from the rim the image does not count."""
    z = np.array([-0.05, 0.05], complex)
    fields = np.zeros((2, 2, len(ring.angle_rad)), complex)
    fields[0] = np.exp(-1j * ring.angle_rad)
    strength, one_V = np.full((2, 1), 1e-4), 1.0
    read = np.exp(-1j * ring.angle_rad)
    driven = read[ring.source] - read[ring.sink]
    sensed = read[ring.read] - read[ring.ground]
    expected = 2 * strength[0, 0] ** 2 * (-(driven.conj() / 0.1**2) / 2 * sensed.conj()).real
    assert scattered(ring, fields, z, strength, one_V) == pytest.approx(expected, abs=0.03 * np.abs(expected).max())
