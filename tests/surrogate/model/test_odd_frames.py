"""Frames whose residuals are not noise of untouched frames and the map's error are called odd, others rarely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.reading_noise import white_noise
from surrogate.data.sensor_ring import Ring
from surrogate.learners.base import regression
from surrogate.model.odd_frames import causes_of, oddness
from touchcal.arrays import Array

FRAMES = 2000


def odd_share(ring: Ring, left: Array, map_part: float = 0.0) -> float:
    n, rng = len(ring.read), np.random.default_rng(0)
    causes = causes_of(ring, rng.normal(size=(30, n)).cumsum(axis=1), white_noise(1e-3, n))
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
