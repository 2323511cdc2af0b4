"""The paper's networks (section 5.1): min-max voltages in, one hidden layer, one output, Bayesian regularisation."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate.learners.base import Estimate
from surrogate.learners.bayesian_network import ensemble
from surrogate.learners.bayesian_network.bayesian_regularisation import Options
from surrogate.learners.bayesian_network.ensemble import Networks
from surrogate.learners.bayesian_network.min_max import MinMax, min_max, scaled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trainbr:
    """Networks on min-max differences to the untouched frame.

    Where the untouched voltages are the same in every row, as on one sensor, these inputs equal the paper's min-max
    voltages exactly, and a frame of another baseline still serves.
    """

    # scaling of the readings, V
    readings: MinMax
    networks: Networks


def learn(signal_V: Array, target: Array, seed: int, options: Options | None = None, workers: int = 1,
          each: Callable[[Iterable[int]], Iterable[int]] = iter) -> Trainbr:
    """Train one network for each column of target (n, outputs) on signals (n, readings), as networks.learn does."""
    readings = min_max(signal_V)
    return Trainbr(readings, ensemble.learn(scaled(readings, signal_V), target, seed, options or Options(), workers,
                                            each))


def estimate(learner: Trainbr, signal_V: Array, noise_V: float) -> Estimate:
    """Outputs of signals (n, readings) under white noise, which the networks' input slopes carry to the outputs."""
    found = ensemble.predict(learner.networks, scaled(learner.readings, signal_V))
    carried = np.sum((found.slope * (noise_V / learner.readings.half_span)) ** 2, axis=2)
    return Estimate(found.value, np.sqrt(found.variance + carried), np.ones(len(signal_V)),
                    np.ones(len(signal_V), bool))
