"""A baseline: one Gaussian process an output, on the features of a signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surrogate.data.outputs import PLACES
from surrogate.data.samples import Samples, SweepSamples
from surrogate.learners.base import Estimate, Learner, Training, regression
from surrogate.learners.located_features import Located, located
from surrogate.learners.signal_features import Directions, carried, features, fit_directions, sound_components
from surrogate.statistics import gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess
from touchcal.arrays import Array

_DRAWS = 6  # of noise, for what it makes of outputs on a curved skin
MOST = 14  # most directions that are inputs: each is a length to be found


@dataclass(frozen=True, eq=False)
class Processes(Learner):
    """One process an output on shared features."""

    directions: Directions
    processes: tuple[GaussianProcess, ...]
    # of a curved skin, whose signals are located, and which outputs (k,) are learned by their logarithm
    located: Located | None = None
    by_log: NDArray[np.bool_] | None = None

    @classmethod
    def fit(cls, rows: Samples, training: Training) -> Processes:
        """Fit a process to each output; of many rows, gaussian_process.MAX_NODES are kept."""
        if isinstance(rows, SweepSamples) and rows.ring.curved is not None:
            return cls._on_curved(rows, training)
        directions = fit_directions(rows.signal_V, sound_components(rows.signal_V, MOST))
        f = features(directions, rows.signal_V)
        return cls(directions, tuple(gaussian_process.fit(f, y) for y in rows.targets(training.names).T))

    @classmethod
    def _on_curved(cls, rows: SweepSamples, training: Training) -> Processes:
        """Processes on the features of `located_features`."""
        force, diameter = rows.targets(["F", "d"]).T
        sheet = located(rows.ring, rows.targets(["x0", "y0", "z0"]), force, diameter, rows.signal_V)
        target = rows.targets(training.names)
        by_log = np.array([name not in PLACES for name in training.names]) & (target > 0).all(axis=0)
        f = sheet.features(rows.signal_V)
        target = np.where(by_log, np.log(np.where(by_log, target, 1.0)), target)
        return cls(fit_directions(rows.signal_V, 1), tuple(gaussian_process.fit(f, y) for y in target.T), sheet, by_log)

    def _located(self, sheet: Located, signal_V: Array, noise_V: float) -> Estimate:
        """Outputs of signals on a curved skin; noise by draws of it, since a place has no slope by a signal."""
        value, variance = self._of_features(sheet.features(signal_V))
        variance = variance + [process.noise[0] for process in self.processes]
        if noise_V > 0:
            rng = np.random.default_rng(0)
            drawn = [self._of_features(sheet.features(signal_V + noise_V * rng.normal(size=signal_V.shape)))[0]
                     for _ in range(_DRAWS)]
            variance = variance + np.mean((np.array(drawn) - value) ** 2, axis=0)
        assert self.by_log is not None, "located signals have outputs of both kinds"
        plain = np.where(self.by_log, np.exp(value), value)
        return regression(plain, np.where(self.by_log, plain**2, 1.0) * variance)

    def _of_features(self, f: Array) -> tuple[Array, Array]:
        found = [gaussian_process.predict(process, f) for process in self.processes]
        return np.column_stack([one[0] for one in found]), np.column_stack([one[2] for one in found])

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """Outputs of signals (n, readings) under white noise, which the slopes carry to the outputs."""
        if self.located is not None:
            return self._located(self.located, signal_V, noise_V)
        f = features(self.directions, signal_V)
        found = [gaussian_process.predict(process, f) for process in self.processes]
        value, variance = (np.column_stack([one[k] for one in found]) for k in (0, 2))
        variance += [process.noise[0] for process in self.processes]
        slope = np.stack([one[1] for one in found], axis=1)
        return regression(value, variance + carried(self.directions, signal_V, slope, noise_V))

    def record(self, training: Training) -> dict[str, Any]:
        """Directions that are inputs, and rows kept."""
        return {"components": len(self.directions.axes), "rows_kept": len(self.processes[0].nodes)}
