"""Whether predictive distributions are calibrated: ranks, expected coverage, and tests of accuracy with random points.

Of intervals alone, the distribution is taken as normal about the value, of that half width at 90 %: on the side of the
target, where an interval reaches farther on one side than on the other.
"""

import numpy as np
from scipy.special import ndtr, ndtri

from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array

LEVELS = (0.25, 0.5, 0.75, 0.9)  # of expected coverage
BINS = 10  # of ranks
DRAWS = 200  # of the predictive distribution a row
LEAST = 1e-100  # half width of a point, which is over any error small


def rank_histogram(target: Array, value: Array, half_width: Array) -> list[float]:
    """Parts of targets (n,) by their rank in the predictive distributions, in BINS bins as likely as each other: even
    where these are calibrated, a bowl where intervals are too narrow (Hamill, Interpretation of rank histograms, Mon.
    Weather Rev. 129, 2001).

    >>> rank_histogram(np.array([0.0, 9.0]), np.zeros(2), np.ones(2))
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5]
    """
    rank = ndtr(normal(COVERAGE) * (target - value) / np.maximum(half_width, LEAST))
    return (np.bincount(np.minimum((BINS * rank).astype(int), BINS - 1), minlength=BINS) / len(rank)).tolist()


def expected_coverage(target: Array, value: Array, half_width: Array) -> list[float]:
    """Parts of targets (n,) that the central intervals of LEVELS hold.

    >>> expected_coverage(np.array([0.0, 0.5]), np.zeros(2), np.ones(2))
    [0.5, 0.5, 1.0, 1.0]
    """
    off = np.abs(target - value) / np.maximum(half_width, LEAST) * normal(COVERAGE)
    return [float(np.mean(off <= ndtri((1 + level) / 2))) for level in LEVELS]


def random_point_coverage(target: Array, value: Array, half_width: Array, seed: int = 0) -> list[float]:
    """Parts of targets (n, k) whose region about a random point has at most each of LEVELS of the probability: those
    levels where distributions are calibrated (TARP: Lemos et al., Sampling-based accuracy testing of posterior
    estimators, ICML 2023). Points are drawn evenly from the box of the targets."""
    rng = np.random.default_rng(seed)
    draws = value + half_width / normal(COVERAGE) * rng.standard_normal((DRAWS, *value.shape))
    point = rng.uniform(target.min(axis=0), target.max(axis=0), target.shape)
    nearer = np.mean(np.linalg.norm(draws - point, axis=2) < np.linalg.norm(target - point, axis=1), axis=0)
    return [float(np.mean(nearer <= level)) for level in LEVELS]
