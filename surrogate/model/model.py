"""A trained surrogate: one learner, the rows it was trained on, and what calibrates its intervals."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surrogate.data import outputs
from surrogate.data.sensor_ring import Ring
from surrogate.learners.base import Estimate
from surrogate.statistics.conformal import COVERAGE, conformal_scale
from surrogate.statistics.metrics import Array
from touchcal import cache
from touchcal.array_store import fingerprint

if TYPE_CHECKING:
    from surrogate.learners.forward import TouchInversion
    from surrogate.learners.gp import Processes
    from surrogate.learners.mlp import Mlp
    from surrogate.learners.network import FeatureNetworks
    from surrogate.learners.ridge import Ridge
    from surrogate.learners.trainbr import Trainbr

METHODS = ("trainbr", "network", "forward", "mlp", "ridge", "gp")
# Methods whose answers take long enough for the scales of their intervals to be kept between runs.
SLOW = ("forward", "gp")
# What decides the scales of intervals.
_CODE = ("surrogate.model.train", "surrogate.model.model")
# Frames that calibrate intervals under noise: as many draws of it for each validation row, up to the most.
NOISY_FRAMES, NOISE_DRAWS = 1000, 4


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
    learner: Trainbr | FeatureNetworks | TouchInversion | Mlp | Ridge | Processes
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
    """ValueError for an unknown method, listing the known."""
    if method not in METHODS:
        raise ValueError(f"method '{method}' is unknown; known: {', '.join(METHODS)}.")


def learner_class(method: str) -> type[Any]:
    """The class of a method's learner, imported when it is asked for, as some need torch; ValueError for another."""
    check_method(method)
    match method:
        case "trainbr":
            from surrogate.learners.trainbr import Trainbr as Learner
        case "network":
            from surrogate.learners.network import FeatureNetworks as Learner
        case "forward":
            from surrogate.learners.forward import TouchInversion as Learner
        case "mlp":
            from surrogate.learners.mlp import Mlp as Learner
        case "ridge":
            from surrogate.learners.ridge import Ridge as Learner
        case _:
            from surrogate.learners.gp import Processes as Learner
    return Learner


def estimate(model: Model, signal_V: Array, noise_V: float = 0.0) -> Estimate:
    """Outputs of signals (n, readings) in V under white noise of standard deviation noise_V, before calibration."""
    learner = sys.modules[learner_class(model.method).__module__]
    return learner.estimate(model.learner, signal_V, noise_V)


def interval_scale(model: Model, noise_V: float = 0.0) -> Array:
    """(outputs,) standard deviations that make a 90 % interval at this noise, from the validation rows."""
    return interval_scales(model, noise_V, (COVERAGE,))[0]


def interval_scales(model: Model, noise_V: float, coverages: Sequence[float]) -> Array:
    """(coverages, outputs) standard deviations that make intervals of these coverages, as interval_scale; kept between
    runs where they take long (TOUCHCAL_CACHE)."""
    if model.method not in SLOW:
        return _scales(model, noise_V, coverages)
    kept, note = cache.kept(_key(model, noise_V, coverages), lambda: {"scales": _scales(model, noise_V, coverages)})
    if note:
        warnings.warn(f"the calibration of intervals is {note}", stacklevel=2)
    return kept["scales"]


def calibrated(model: Model, noise_V: float) -> bool:
    """Whether interval_scale answers at once at this noise."""
    return model.method not in SLOW or cache.stored(_key(model, noise_V, (COVERAGE,))) is not None


def _key(model: Model, noise_V: float, coverages: Sequence[float]) -> str:
    """What the scales of a model follow from, for the cache."""
    return cache.key_of({"model": fingerprint(model.ring, model.learner, model.calibration), "names": list(model.names),
                         "seed": model.seed, "noise_V": float(noise_V), "coverages": list(coverages)}, _CODE)


def _scales(model: Model, noise_V: float, coverages: Sequence[float]) -> Array:
    rows = model.calibration
    draws = min(NOISE_DRAWS, -(-NOISY_FRAMES // len(rows.target))) if noise_V > 0 else 1
    signal, target = np.tile(rows.signal_V, (draws, 1)), np.tile(rows.target, (draws, 1))
    noisy = signal + noise_V * np.random.default_rng(model.seed).normal(size=signal.shape)
    found = estimate(model, noisy, noise_V)
    error, few = found.value - target, discrete(model)
    return np.array([conformal_scale(error, found.sd, len(rows.target), c, few) for c in coverages])


def discrete(model: Model) -> NDArray[np.bool_]:
    """(outputs,) whether an output takes one of a few values: the diameter where punches are known."""
    if model.method != "forward":
        return np.zeros(len(model.names), bool)
    from surrogate.learners.forward import TouchInversion
    assert isinstance(model.learner, TouchInversion)
    known = len(model.learner.forward.known_mm) > 0
    return np.array([known and name == "d" for name in model.names])
