"""A baseline: one Gaussian process an output, on the features of a signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from surrogate.data.samples import Samples
from surrogate.learners.base import Estimate, Learner, Training, regression
from surrogate.learners.signal_features import Directions, carried, features, fit_directions, sound_components
from surrogate.statistics import gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess
from touchcal.arrays import Array

MOST = 14  # most directions that are inputs: each is a length to be found


@dataclass(frozen=True, eq=False)
class Processes(Learner):
    """One process an output on shared features."""

    directions: Directions
    processes: tuple[GaussianProcess, ...]

    @classmethod
    def fit(cls, rows: Samples, training: Training) -> Processes:
        """Fit a process to each output; of many rows, gaussian_process.MAX_NODES are kept."""
        directions = fit_directions(rows.signal_V, sound_components(rows.signal_V, MOST))
        f = features(directions, rows.signal_V)
        return cls(directions, tuple(gaussian_process.fit(f, y) for y in rows.targets(training.names).T))

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """Outputs of signals (n, readings) under white noise, which the slopes carry to the outputs."""
        f = features(self.directions, signal_V)
        found = [gaussian_process.predict(process, f) for process in self.processes]
        value, variance = (np.column_stack([one[k] for one in found]) for k in (0, 2))
        variance += [process.noise[0] for process in self.processes]
        slope = np.stack([one[1] for one in found], axis=1)
        return regression(value, variance + carried(self.directions, signal_V, slope, noise_V))

    def record(self, training: Training) -> dict[str, Any]:
        """Directions that are inputs, and rows kept."""
        return {"components": len(self.directions.axes), "rows_kept": len(self.processes[0].nodes)}
