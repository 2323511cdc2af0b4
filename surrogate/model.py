"""A trained surrogate: one learner, the rows it was trained on, and what calibrates its intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surrogate import outputs
from surrogate.estimate import Estimate
from surrogate.intervals import COVERAGE, conformal_scale
from surrogate.metrics import Array
from surrogate.ring import Ring

if TYPE_CHECKING:
    from surrogate.ridge import Ridge
    from surrogate.touch_inversion import TouchInversion
    from surrogate.trainbr import Networks

METHODS = ("trainbr", "forward", "ridge")
NOT_BUILT = ("mlp",)
# Draws of noise for each validation row when intervals are calibrated under noise.
NOISE_DRAWS = 4


@dataclass(frozen=True)
class Calibration:
    """Validation rows, which neither train the learner nor test it."""

    # (n, readings) signals, V
    signal_V: Array
    # (n, outputs) targets
    target: Array


@dataclass(frozen=True)
class Rows:
    """The rows of the data set that the model was made from."""

    # (n,) hash of each row, and its part: an index into split.PARTS
    row_hash: NDArray[np.uint64]
    part: NDArray[np.int64]


@dataclass(frozen=True)
class Range:
    """What the training rows span; predictions beyond it are flagged."""

    # (outputs,) lowest and highest target
    lowest: Array
    highest: Array
    # norm of the weakest signal, V
    weakest_V: float
    # largest misfit of a validation row
    misfit: float


@dataclass(frozen=True)
class Model:
    """A learner for some outputs of one sensor."""

    # one of METHODS
    method: str
    ring: Ring
    # names of the outputs, in the order of outputs.NAMES
    names: tuple[str, ...]
    learner: Networks | TouchInversion | Ridge
    calibration: Calibration
    rows: Rows
    trained: Range
    # (readings,) voltages of the untouched sensor, V
    baseline_V: Array
    seed: int
    # CPU time of the training, s
    fit_s: float
    # how the training went and what it was made from, as JSON
    record: Mapping[str, Any]

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each output."""
        return tuple(outputs.of(name).unit for name in self.names)


def check_method(method: str) -> None:
    """ValueError for a method that is unknown or not built, listing those that are."""
    built = ", ".join(METHODS)
    if method in NOT_BUILT:
        raise ValueError(f"method '{method}' is not built yet; built: {built}.")
    if method not in METHODS:
        raise ValueError(f"method '{method}' is unknown; known: {built} (and {', '.join(NOT_BUILT)}, not built yet).")


def estimate(model: Model, signal_V: Array, noise_V: float = 0.0) -> Estimate:
    """Outputs of signals (n, readings) in V under white noise of standard deviation noise_V, before calibration."""
    match model.method:
        case "trainbr":
            from surrogate import trainbr as learner
        case "forward":
            from surrogate import touch_inversion as learner
        case "ridge":
            from surrogate import ridge as learner
        case other:
            raise ValueError(f"method '{other}' is unknown; known: {', '.join(METHODS)}.")
    return learner.estimate(model.learner, signal_V, noise_V)  # pyright: ignore[reportArgumentType]


def interval_scale(model: Model, noise_V: float = 0.0) -> Array:
    """(outputs,) standard deviations that make a 90 % interval at this noise, from the validation rows."""
    return interval_scales(model, noise_V, (COVERAGE,))[0]


def interval_scales(model: Model, noise_V: float, coverages: Sequence[float]) -> Array:
    """(coverages, outputs) standard deviations that make intervals of these coverages, as interval_scale."""
    rows = model.calibration
    draws = NOISE_DRAWS if noise_V > 0 else 1
    signal, target = np.tile(rows.signal_V, (draws, 1)), np.tile(rows.target, (draws, 1))
    noisy = signal + noise_V * np.random.default_rng(model.seed).normal(size=signal.shape)
    found = estimate(model, noisy, noise_V)
    return np.array([conformal_scale(found.value - target, found.sd, len(rows.target), c) for c in coverages])
