"""How good predictions are: errors, explained variance, and how often the interval holds the truth."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array

NOISE_REFERENCES = ("baseline", "signal")
COVERAGES = (0.50, 0.90, 0.95)  # parts of the rows that scored intervals are to hold


@dataclass(frozen=True)
class Score:
    """Errors of one output on one set of rows; squares carry the unit squared."""

    mse: float
    rmse: float
    r2: float | None  # coefficient of determination; None where the targets do not vary
    mae: float
    n: int  # rows
    # fraction of rows whose 50, 90 and 95 % interval holds the target
    coverage_50: float
    coverage_90: float
    coverage_95: float
    unit: str  # unit of rmse, mae and half_width_90
    half_width_90: float  # median half width of the 90 % intervals


def score(target: Array, value: Array, below: Array, above: Array, unit: str) -> Score:
    """Score predictions (n,) with intervals from value - below to value + above (3, n), one for each of COVERAGES."""
    error = value - target
    mse = float(np.mean(error**2))
    spread = float(np.var(target))
    r2 = 1 - mse / spread if spread > 1e-20 * max(1.0, float(np.mean(target**2))) else None
    half, ninety, ninety_five = (float(np.mean((error <= low) & (-error <= high)))
                                 for low, high in zip(below, above, strict=True))
    width = (below + above)[COVERAGES.index(0.90)] / 2
    return Score(mse, float(np.sqrt(mse)), r2, float(np.mean(np.abs(error))), len(target), half, ninety, ninety_five,
                 unit, float(np.median(width)))


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
