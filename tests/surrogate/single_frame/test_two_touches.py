"""Two touches read from one frame by superposition."""

from collections.abc import Callable

import numpy as np
import pytest

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map.forward_map import ForwardMap, fit, linearise
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.single_frame.two_touches import Pair, read_pair
from touchcal.arrays import Array

NOISE_V = 2e-4


@pytest.fixture(scope="module")
def forward(ring: Ring, synthetic: Callable[..., tuple[Array, Array]]) -> ForwardMap:
    return fit(ring, *synthetic(120, 1))


def read(forward: ForwardMap, touches: Array, seed: int = 0) -> Pair:
    clean = linearise(forward, to_unknown(touches, forward.p0)).signal_V.sum(axis=0)
    frame = clean + NOISE_V * np.random.default_rng(seed).normal(size=clean.size)
    alone = invert(forward, frame[None], NOISE_V).touch
    return read_pair(forward, frame, NOISE_V, to_unknown(alone, forward.p0)[0])


def test_two_touches_are_found_in_either_order(forward: ForwardMap) -> None:
    both = np.array([[-30.0, 12.0, 14.0, 1.2], [28.0, -20.0, 12.0, 0.8]])
    found, turned = read(forward, both), read(forward, both[::-1])
    assert found.two
    assert not found.too_near
    assert np.all(np.hypot(*(found.touch - both)[:, :2].T) < 2.0)
    assert turned.touch == pytest.approx(found.touch, abs=1e-6)


def test_one_touch_is_not_split_in_two(forward: ForwardMap) -> None:
    assert not any(read(forward, np.array([[15.0, -25.0, 14.0, 1.0]]), seed).two for seed in range(3))
