"""Frames whose residuals are not those of the noise of untouched frames and of the map are odd, others rarely."""

from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.reading_noise import white_noise
from surrogate.data.sensor_ring import Ring
from surrogate.learners.base import regression
from surrogate.model.odd_frames import causes_of, oddness
from touchcal.arrays import Array

FRAMES = 2000


def odd_share(ring: Ring, left: Array, map_part: float = 0.0, signal_V: Array | None = None) -> float:
    n = len(ring.read)
    drawn = np.random.default_rng(0).normal(size=(30, n)).cumsum(axis=1)
    causes = causes_of(ring, drawn if signal_V is None else signal_V, white_noise(1e-3, n))
    plain = regression(np.zeros((len(left), 4)), np.ones((len(left), 4)))
    found = replace(plain, left=left, misfit=np.mean(left**2, axis=1), map_part=np.full(len(left), map_part))
    return float(np.mean(oddness(causes, found, 2.0) > 1))


def test_white_residuals_are_rarely_odd(ring: Ring) -> None:
    share = odd_share(ring, np.random.default_rng(1).normal(size=(FRAMES, len(ring.read))))
    print("odd of white residuals:", share)
    assert share < 0.01


@pytest.mark.parametrize("kind", ["larger", "of patterns", "of neighbours"])
def test_residuals_that_are_larger_or_shared_are_odd(ring: Ring, kind: str) -> None:
    """Shared ones have the energy of white ones: their number of degrees alone differs."""
    n, rng = len(ring.read), np.random.default_rng(2)
    white = rng.normal(size=(200, n))
    pattern = np.unique(np.column_stack([ring.source, ring.sink]), axis=0, return_inverse=True)[1].ravel()
    shared = (white + rng.normal(size=(200, n))[:, pattern]) / np.sqrt(2)
    smooth = np.linalg.cholesky(np.exp(-np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / 20) + 1e-9 * np.eye(n))
    left = {"larger": 1.4 * white, "of patterns": shared, "of neighbours": white @ smooth.T}[kind]
    share = odd_share(ring, left)
    print(kind, "odd:", share)
    assert share > 0.9


def test_the_map_may_leave_more_where_it_is_most_of_the_error(ring: Ring) -> None:
    left = 1.4 * np.random.default_rng(3).normal(size=(200, len(ring.read)))
    assert odd_share(ring, left, map_part=1.0) == 0


@pytest.mark.thorough
def test_little_of_another_touch_is_odd_where_noise_hides_most_of_what_touches_differ_by(ring: Ring) -> None:
    """Of the directions of trained signals those count alone that exceed the noise: the fewer, the less makes a frame
    odd along them."""
    n, rng = len(ring.read), np.random.default_rng(4)
    axes = np.linalg.qr(rng.normal(size=(n, 20)))[0].T
    part = np.arange(20) < 6
    few, many = (rng.normal(size=(30, 20)) * np.where(part, 1.0, rest) @ axes for rest in (1e-5, 1.0))
    left = rng.normal(size=(FRAMES, n))
    other = left + np.sqrt(20.0) * axes[2]
    shares = [odd_share(ring, other, signal_V=signal_V) for signal_V in (many, few)]
    print("odd, all directions and few:", shares)
    assert shares[0] < 0.5
    assert shares[1] > 0.7
    assert odd_share(ring, left, signal_V=few) < 0.01
