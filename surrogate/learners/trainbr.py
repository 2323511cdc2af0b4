"""The paper's networks (section 5.1): min-max voltages in, one hidden layer, one output, Bayesian regularisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from surrogate.data.samples import Samples
from surrogate.learners.base import Estimate, Learner, Training, regression
from surrogate.learners.bayesian_network import ensemble
from surrogate.learners.bayesian_network.bayesian_regularisation import Options
from surrogate.learners.bayesian_network.ensemble import Networks
from surrogate.learners.bayesian_network.min_max import MinMax, min_max, scaled
from touchcal.arrays import Array


@dataclass(frozen=True)
class Trainbr(Learner):
    """Networks on min-max differences to the untouched frame.

    Where the untouched voltages are the same in every row, as on one sensor, these inputs equal the paper's min-max
    voltages exactly, and a frame of another baseline still serves.
    """

    readings: MinMax  # scaling of the readings, V
    networks: Networks

    @classmethod
    def fit(cls, rows: Samples, training: Training) -> Trainbr:
        """Train one network for each output, as ensemble.fit does."""
        readings = min_max(rows.signal_V)
        return cls(readings, ensemble.fit(scaled(readings, rows.signal_V), rows.targets(training.names), training.seed,
                                          Options(epochs=training.epochs), training.workers, training.each))

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """Outputs of signals (n, readings) under white noise, which the networks' input slopes carry to the outputs."""
        found = ensemble.predict(self.networks, scaled(self.readings, signal_V))
        carried = np.sum((found.slope * (noise_V / self.readings.half_span)) ** 2, axis=2)
        return regression(found.value, found.variance + carried)

    def record(self, training: Training) -> dict[str, Any]:
        """How the training of each output's network ended."""
        return ensemble.record(self.networks, training.names)
