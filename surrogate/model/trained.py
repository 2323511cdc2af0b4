"""What a training leaves: one learner, the rows it was trained on, and what calibrates its intervals."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surrogate.data import outputs
from surrogate.data.reading_noise import ReadingNoise, white_noise
from surrogate.data.sensor_ring import Ring
from surrogate.learners.base import Estimate, Learner
from surrogate.learners.registry import METHODS
from surrogate.statistics.conformal import COVERAGE, IntervalScale, conformal_scales, normal
from touchcal import cache
from touchcal.array_store import fingerprint
from touchcal.arrays import Array, Mask

_CODE = ("surrogate.model.train", "surrogate.model.trained")  # what decides the scales of intervals
# Frames that calibrate intervals under noise: as many draws of it for each validation row, up to the most.
NOISY_FRAMES, NOISE_DRAWS = 1000, 4
FEWEST = 9  # rows from which on their errors have an order statistic at 90 %
SLACK = 0.02  # how far outside the training targets, in their ranges, a value may lie before it is flagged
# An interval of F wider than this part of its training range says that d and F have several answers.
SEVERAL_PART = 0.5


@dataclass(frozen=True)
class Calibration:
    """Validation rows, which neither train the learner nor test it."""

    signal_V: Array  # (n, readings) signals, V
    target: Array  # (n, outputs) targets
    signal_sd: Array  # (n,) standard deviations of the simulator's own relative errors of the signals


@dataclass(frozen=True)
class Rows:
    """The rows of the data set that the model was made from."""

    row_hash: NDArray[np.uint64]  # (n,) hash of each row
    part: NDArray[np.int64]  # (n,) its part: an index into samples.PARTS


@dataclass(frozen=True)
class Range:
    """What the training rows span; predictions outside it are flagged."""

    lowest: Array  # (outputs,) lowest target
    highest: Array  # (outputs,) highest target
    weakest_V: float  # norm of the weakest signal, V
    misfit: float  # largest misfit of a validation row


@dataclass(frozen=True)
class TrainedModel:
    """A learner for some outputs of one sensor."""

    method: str  # name in the registry of learners
    ring: Ring
    names: tuple[str, ...]  # names of the outputs, in the order of outputs.NAMES
    learner: Learner
    calibration: Calibration
    rows: Rows
    trained: Range
    baseline_V: Array  # (readings,) voltages of the untouched sensor, V
    seed: int
    fit_s: float  # CPU time of the training, s
    record: Mapping[str, Any]  # how the training went and what it was made from, as JSON

    @property
    def readings(self) -> int:
        """Readings of a frame."""
        return len(self.baseline_V)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each output."""
        return tuple(outputs.of(name).unit for name in self.names)


def trained_radius_mm(model: TrainedModel) -> float:
    """Largest distance of trained touches from a disc's centre, by the calibrating ones and the range of each
    coordinate, mm."""
    k = [model.names.index(name) for name in ("x0", "y0")]
    ends = np.abs([model.trained.lowest[k], model.trained.highest[k]]).max()
    return max(float(np.hypot(*model.calibration.target[:, k].T).max()), float(ends))


def estimate(model: TrainedModel, signal_V: Array, noise: ReadingNoise | float = 0.0) -> Estimate:
    """Outputs of signals (n, readings) in V under this noise, before calibration; a number is the standard deviation of
    white noise, V. Methods that do not model the signal take all noise for white."""
    if isinstance(noise, float | int):
        return model.learner.estimate(signal_V, noise)
    if METHODS[model.method].separates_errors and noise.root.size:
        return model.learner.drifting(noise.root).estimate(signal_V, noise.white_V)
    return model.learner.estimate(signal_V, noise.rms_V)


def interval_scale(model: TrainedModel, noise: ReadingNoise | float = 0.0) -> IntervalScale:
    """How many standard deviations make a 90 % interval at this noise, from the validation rows and draws of the
    simulator's own error of their signals; of the rows whose answers promise a coverage."""
    return interval_scales(model, noise, (COVERAGE,))[0]


def interval_scales(model: TrainedModel, noise: ReadingNoise | float, coverages: Sequence[float]
                    ) -> list[IntervalScale]:
    """Those of intervals of these coverages, as interval_scale; kept between runs where they take long
    (TOUCHCAL_CACHE)."""
    known = _whole(model, noise)
    if not METHODS[model.method].slow:
        return _scales(model, known, coverages)

    def arrays() -> dict[str, Array]:
        made = _scales(model, known, coverages)
        return {"edge": np.stack([one.edge for one in made]), "factor": np.stack([one.factor for one in made])}

    kept, note = cache.kept(_key(model, known, coverages), arrays)
    if note:
        warnings.warn(f"the calibration of intervals is {note}", stacklevel=2)
    return [IntervalScale(*one) for one in zip(kept["edge"], kept["factor"], strict=True)]


def calibrated(model: TrainedModel, noise: ReadingNoise | float) -> bool:
    """Whether interval_scale answers at once at this noise."""
    known = _whole(model, noise)
    return not METHODS[model.method].slow or cache.stored(_key(model, known, (COVERAGE,))) is not None


def _whole(model: TrainedModel, noise: ReadingNoise | float) -> ReadingNoise:
    return noise if isinstance(noise, ReadingNoise) else white_noise(float(noise), model.calibration.signal_V.shape[1])


def _key(model: TrainedModel, noise: ReadingNoise, coverages: Sequence[float]) -> str:
    shared = {"root": fingerprint(noise)} if noise.root.size else {}
    return cache.key_of({"model": fingerprint(model.ring, model.learner, model.calibration), "names": list(model.names),
                         "seed": model.seed, "noise_V": noise.white_V, "coverages": list(coverages), **shared}, _CODE)


def _scales(model: TrainedModel, noise: ReadingNoise, coverages: Sequence[float]) -> list[IntervalScale]:
    rows, rng = model.calibration, np.random.default_rng(model.seed)
    drawn = noise.rms_V > 0 or np.any(rows.signal_sd > 0)
    draws = min(NOISE_DRAWS, -(-NOISY_FRAMES // len(rows.target))) if drawn else 1
    signal, target = np.tile(rows.signal_V, (draws, 1)), np.tile(rows.target, (draws, 1))
    noisy = signal + noise.draws(len(signal), rng)
    # the simulator's error, as the forward map counts it
    noisy += signal * (np.tile(rows.signal_sd, draws) * rng.normal(size=len(target)))[:, None]
    found = estimate(model, noisy, noise)
    branched = model.learner.branched(model.names)
    place = np.array([name in outputs.PLACES for name in model.names])  # no direction is another's

    def scaled(coverage: float, sure: Mask) -> IntervalScale:  # of the whole interval, as it is answered
        least, count = found.least_factor(target, normal(coverage)), round(len(rows.target) * float(sure.mean()))
        return conformal_scales(least[sure], np.ones_like(least[sure]), found.sd[sure], count, (coverage,), branched,
                                found.near_edge[sure], place)[0]

    def if_enough(sure: Mask) -> Mask:
        return sure if len(rows.target) * sure.mean() >= FEWEST else np.ones(len(sure), bool)

    # flagged answers promise no coverage; whether F has several answers is said of its calibrated interval
    sure = if_enough(found.inside & ~found.other & ~outside_range(model, found).any(axis=1))
    first = scaled(COVERAGE, sure).of(found.sd, found.near_edge)
    sure = if_enough(sure & ~several_answers(model, np.add(*found.of_profile(first, normal(COVERAGE)))))
    return [scaled(one, sure) for one in coverages]


def outside_range(model: TrainedModel, found: Estimate) -> Mask:
    """(n, outputs) whether a value lies outside its training range, SLACK and rounding aside. The map of a disc is one
    of every direction: a place is outside where the trained ones lie nearer to the centre, too."""
    slack = SLACK * (model.trained.highest - model.trained.lowest) + outputs.ROUNDING * np.abs(model.trained.highest)
    off = (found.value < model.trained.lowest - slack) | (found.value > model.trained.highest + slack)
    if METHODS[model.method].separates_errors and model.ring.sheet is None and {"x0", "y0"} <= set(model.names):
        k = [model.names.index(name) for name in ("x0", "y0")]
        off[:, k] &= (np.hypot(*found.value[:, k].T) > trained_radius_mm(model) + slack[k].max())[:, None]
    return off


def several_answers(model: TrainedModel, width: Array) -> Mask:
    """(n,) whether the interval of F, of widths (n, outputs), is so wide that F has no one answer."""
    if "F" not in model.names or not METHODS[model.method].separates_errors:
        return np.zeros(len(width), bool)
    k = model.names.index("F")
    return width[:, k] > SEVERAL_PART * (model.trained.highest - model.trained.lowest)[k]
