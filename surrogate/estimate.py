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
