"""Intervals grow with the distance of a pattern from the nearest taught one. All numbers are drawn."""

import numpy as np
import pytest

from surrogate.statistics.conformal import calibrated
from surrogate.statistics.nearness import learn_nearness
from touchcal.arrays import Array


def patterns(rng: np.random.Generator, count: int) -> Array:
    """(count, 20) patterns about places of a square."""
    return np.hstack([rng.uniform(-1, 1, (count, 2)), 1e-3 * rng.standard_normal((count, 18))])


@pytest.mark.parametrize("power", [0.0, 1.0, 2.0])
def test_far_patterns_are_held_as_often_as_near_ones_however_errors_grow(power: float) -> None:
    parts, plain = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        pattern, new, blocks = patterns(rng, 20), patterns(rng, 900), np.arange(20)
        near, held_out = learn_nearness(pattern, blocks)

        def errors(at: Array, taught: Array, rng: np.random.Generator = rng) -> tuple[Array, Array]:
            away = np.linalg.norm(at[:, None] - taught, axis=2).min(axis=1)
            return (0.1 + away[:, None] ** power) * rng.standard_normal((len(at), 2)), away

        known = np.concatenate([errors(pattern[[k]], np.delete(pattern, k, axis=0))[0] for k in range(20)])
        error, away = errors(new, pattern)
        none = np.zeros((len(error), 2))
        far = away > np.quantile(away, 2 / 3)
        for held, wider, old in ((parts, near.widening(new), held_out), (plain, np.ones(900), np.ones(20))):
            half = calibrated(known / old[:, None], none[:20], none[:20, 0]).half_width(none) * wider[:, None]
            held.append([np.mean(np.abs(error)[rows] <= half[rows]) for rows in (far, ~far)])
    (far, close), (before, _) = np.mean(parts, axis=0), np.mean(plain, axis=0)
    assert min(far, close) > 0.84
    assert not power or far > before + 0.01
