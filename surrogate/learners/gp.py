"""A baseline: one Gaussian process an output, on the features of a signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate.learners.base import Estimate
from surrogate.learners.signal_features import Directions, carried, features, learn_directions, sound_components
from surrogate.statistics import gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess

Array = NDArray[np.float64]

# Most directions that are inputs: each is a length to be found.
MOST = 14


@dataclass(frozen=True, eq=False)
class Processes:
    """One process an output on shared features."""

    directions: Directions
    processes: tuple[GaussianProcess, ...]


def learn(signal_V: Array, target: Array) -> Processes:
    """Fit signals (n, readings) to targets (n, outputs); of many rows, gaussian_process.MAX_NODES are kept."""
    directions = learn_directions(signal_V, sound_components(signal_V, MOST))
    f = features(directions, signal_V)
    return Processes(directions, tuple(gaussian_process.fit(f, y) for y in target.T))


def estimate(learner: Processes, signal_V: Array, noise_V: float) -> Estimate:
    """Outputs of signals (n, readings) under white noise, which the slopes carry to the outputs."""
    f = features(learner.directions, signal_V)
    found = [gaussian_process.predict(process, f) for process in learner.processes]
    value, variance = (np.column_stack([one[k] for one in found]) for k in (0, 2))
    variance += [process.noise[0] for process in learner.processes]
    slope = np.stack([one[1] for one in found], axis=1)
    return Estimate(value, np.sqrt(variance + carried(learner.directions, signal_V, slope, noise_V)),
                    np.ones(len(signal_V)), np.ones(len(signal_V), bool))
