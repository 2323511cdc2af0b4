"""What every learner returns for signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """Most probable outputs of some signals."""

    # (n, outputs) values in the outputs' units
    value: Array
    # (n, outputs) standard deviations, model and noise together, before calibration
    sd: Array
    # (n,) squared residual of the signal over what was expected; 1 for learners that do not model the signal
    misfit: Array
    # (n,) whether the touch lies among the trained ones; True for learners that only map signals to outputs
    inside: NDArray[np.bool_]
    # what makes up sd, for learners that can tell
    parts: Parts | None = None


@dataclass(frozen=True)
class Parts:
    """Parts of standard deviations (n, outputs); their squares and that of the model's part add up to the whole."""

    # by noise alone, were map and material exact
    noise: Array
    # what not knowing the material adds
    material: Array

    def model(self, sd: Array) -> Array:
        """(n, outputs) the rest of sd: the map's own error, and what of the signal it does not explain."""
        return np.sqrt(np.maximum(sd**2 - self.noise**2 - self.material**2, 0.0))
