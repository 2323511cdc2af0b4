"""Touches from recorded frames: values, 90 % intervals and flags."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from surrogate.data import outputs
from surrogate.data.dead_readings import Names, most_lacked, too_many
from surrogate.data.flags import WORDS, Flag, in_words
from surrogate.data.frame_drift import FrameDrift, by_gain, no_drift
from surrogate.data.frame_rows import Lines
from surrogate.data.reading_noise import ReadingNoise, white_noise
from surrogate.learners.base import Estimate, joined
from surrogate.learners.novelty import (
    Novelty,
    fit_novelty,
    novelty_score,
    of_other_sign,
    one_column,
    with_directions,
)
from surrogate.learners.registry import METHODS
from surrogate.model.drift_choice import drift_groups
from surrogate.model.holding_time import STRESSES, stress_left
from surrogate.model.missing_channels import cost_words, filled_in, named, silent, without
from surrogate.model.odd_frames import Causes, causes_of, oddness
from surrogate.model.trained import TrainedModel, estimate, interval_scale, outside_range, several_answers
from surrogate.statistics.conformal import COVERAGE, IntervalScale, at_least, normal, one_factor
from touchcal.arrays import Array, Index, Mask

SIZE = "the signal's size"  # in flags
WEAK = 0.5  # a signal below this part of the weakest training signal is no touch
MOST_WIDENED = 1000.0  # largest factor by which a strange signal widens the intervals
# Norm of a signal, over that of the strongest validation row, from which it is outside the training range, and from
# which no touch is read from it.
STRONG, WILD = 1.2, 30.0
# Least factor by which a touch outside the training range widens the intervals; but for the place, they are as wide as
# the range of the training there.
OUTSIDE_WIDENED = 10.0
PARTS = ("noise", "material", "model")  # what makes up the standard deviation of a force


@dataclass(frozen=True, eq=False)
class Predictor:
    """A model with what does not change from frame to frame."""

    model: TrainedModel
    baseline_V: Array  # (readings,) the untouched frame, V
    noise: ReadingNoise  # of a signal
    scale: IntervalScale  # standard deviations that make a 90 % interval
    span: Novelty  # of the touches
    novelty: Novelty  # the same, with what drift may add
    causes: Causes  # of what touches leave of frames
    dead: Mask  # (readings,) channels that are dead whatever a frame reads
    drift: FrameDrift  # between the untouched and the touched frames
    gains: Array  # (readings, electrodes) derivatives of the readings by gains, V; no columns where drift is counted
    left: float  # stresses of the foam at the time of reading, over those of the training
    # predictors of the readings that are left, by the bytes of a mask of dead channels
    reduced: dict[bytes, Predictor] = field(default_factory=dict)


@dataclass(frozen=True)
class Predictions:
    """One row a frame; NaN where a frame has no touch to read."""

    value: Array  # (n, outputs)
    # (n, outputs) distances of the values to the lower and upper ends of the 90 % intervals
    below: Array
    above: Array
    flag: list[str]  # (n,) what is to be known of the frame, in words, empty where nothing is
    # (n, 3) parts of the force's standard deviation by noise, material and model, N; their squares add up to that of
    # half_width over the normal factor. No columns where the model cannot tell
    force_parts: Array
    kinds: NDArray[np.int64]  # (n,) of what is to be known, a sum of `Flag`

    @property
    def half_width(self) -> Array:
        """(n, outputs) half widths of the 90 % intervals."""
        return (self.below + self.above) / 2


def prepare(model: TrainedModel, baseline_V: Array, noise: ReadingNoise | float = 0.0, dead: Mask | None = None, *,
            calibrate: bool = True, held_s: float | None = None, drift: FrameDrift | None = None) -> Predictor:
    """What predicting frames needs, once for a stream of frames.

    noise: of a signal; a number is the standard deviation of white noise, V;
    dead: (readings,) channels known to be dead, besides those that the baseline shows; calibrate: whether intervals are
    calibrated, which may invert every calibration row; held_s: as `holding_time.stress_left`; drift: what may change
    between the frames, which the calibration of intervals does not draw. ValueError for a noise that is no finite
    number from 0, a holding time that the model has no relaxation for, or a drift that the method does not know.
    """
    known = noise if isinstance(noise, ReadingNoise) else white_noise(noise, len(baseline_V))
    if not 0 <= known.white_V <= known.rms_V < np.inf:
        raise ValueError(f"the noise of one reading must be a finite number of volts from 0, got {known.white_V:g}. "
                         "Give `noise_V` VOLTS, or untouched frames that scatter less.")
    lost = silent(baseline_V[None], model.baseline_V)[0] | (False if dead is None else dead)
    scale = interval_scale(model, known) if calibrate else one_factor(np.ones(len(model.names)))
    span, drift = fit_novelty(model.ring, model.calibration.signal_V), drift or no_drift(len(baseline_V))
    novelty, gains = span, drift.gain[:, :0]
    if drift.root.size:
        model.learner.drifting(drift.root)
        novelty = with_directions(span, drift.root)
    else:
        gains = _gains(model)
    return Predictor(model, baseline_V, known, scale, span, novelty,
                     causes_of(model.ring, model.calibration.signal_V, known), lost, drift, gains,
                     stress_left(model, held_s))


def _estimate(predictor: Predictor, signal: Array) -> Estimate:
    """Outputs of signals (n, readings), V; where drift is counted, of each with the gains that drifted."""
    model = predictor.model
    if not predictor.drift.root.size:
        return estimate(model, signal, predictor.noise)
    noise = predictor.noise
    rows, roots = zip(*drift_groups(predictor.drift, predictor.span, signal, noise.rms_V), strict=True)
    found = [model.learner.drifting(np.hstack([root, noise.root])).estimate(signal[group], noise.white_V)
             for group, root in zip(rows, roots, strict=True)]
    return joined(found).some(np.argsort(np.concatenate(rows)))


def _gains(model: TrainedModel) -> Array:
    try:
        return by_gain(model.ring, model.baseline_V)
    except ValueError:  # of a sensor whose potentials are not foreseen, no channel is named
        return np.zeros((len(model.baseline_V), 0))


def predict(predictor: Predictor, volts: Array) -> Predictions:
    """Predictions of frames (n, readings), V.

    Channels that are dead in a frame are left out of its misfit where the model can do that, else filled in from the
    others; intervals are calibrated without them, never by less than with them, and no frame is flagged for it.
    """
    shape = (len(volts), len(predictor.model.names))
    found = Predictions(*(np.full(shape, np.nan) for _ in range(3)), flag=[""] * len(volts),
                        force_parts=np.full((len(volts), _force_part_count(predictor.model)), np.nan),
                        kinds=np.zeros(len(volts), np.int64))
    for mask, rows in _groups(dead_in(predictor, volts)):
        part = _without(predictor, mask, volts[rows]) if mask.any() else _sound(predictor, volts[rows])
        found.value[rows], found.below[rows], found.above[rows] = part.value, part.below, part.above
        found.force_parts[rows], found.kinds[rows] = part.force_parts, part.kinds
        for row, flag in zip(rows.tolist(), part.flag, strict=True):
            found.flag[row] = flag
    return found


def dead_in(predictor: Predictor, volts: Array) -> Mask:
    """(n, readings) channels that frames (n, readings), V, are read without."""
    return silent(volts, predictor.model.baseline_V) | predictor.dead


def lost_words(predictor: Predictor, volts: Array, columns: Names = ()) -> str:
    """In words, which channels are dead in frames (n, readings), V, those that most of them lack, and what that costs;
    empty where none is, or too many are."""
    return most_lacked(dead_in(predictor, volts), volts.shape[1],
                       lambda dead: cost_words(predictor.model, dead, predictor.noise, columns))


def _groups(dead: Mask) -> Iterator[tuple[Mask, Index]]:
    """Masks of dead channels, each with the frames that have it."""
    if not dead.any():
        yield np.zeros(dead.shape[1], bool), np.arange(len(dead))
        return
    masks, which = np.unique(dead, axis=0, return_inverse=True)
    for k, mask in enumerate(masks):
        yield mask, np.flatnonzero(which.ravel() == k)


def _without(predictor: Predictor, dead: Mask, volts: Array) -> Predictions:
    if problem := too_many(dead):
        none = np.full((len(volts), len(predictor.model.names)), np.nan)
        return Predictions(none, none, none, [f"{named(dead)}; {problem}"] * len(volts),
                           none[:, :_force_part_count(predictor.model)], np.zeros(len(volts), np.int64))
    if (key := dead.tobytes()) not in predictor.reduced:
        predictor.reduced[key] = _lacking(predictor, dead)
    fewer, baseline_V = predictor.reduced[key], np.where(dead, predictor.model.baseline_V, predictor.baseline_V)
    if fewer.model.readings == len(dead):
        volts = baseline_V + filled_in(predictor.model, np.where(dead, np.nan, volts - baseline_V))
        return _sound(replace(fewer, baseline_V=baseline_V), volts)
    return _sound(replace(fewer, baseline_V=baseline_V[~dead]), volts[:, ~dead])


def _lacking(predictor: Predictor, dead: Mask) -> Predictor:
    """What reads frames without some channels, or with these filled in."""
    model = without(predictor.model, dead)
    kept = ~dead if model.readings < len(dead) else np.ones(len(dead), bool)
    made = prepare(model, np.where(dead, predictor.model.baseline_V, predictor.baseline_V)[kept],
                   predictor.noise.of(kept), drift=predictor.drift.of(kept))
    return replace(made, scale=at_least(made.scale, predictor.scale), left=predictor.left)


def _sound(predictor: Predictor, volts: Array) -> Predictions:
    return judged(predictor, volts, lambda signal: _estimate(predictor, signal))


def judged(predictor: Predictor, volts: Array, read: Callable[[Array], Estimate]) -> Predictions:
    """Predictions of frames (n, readings), V, that have all their channels, from what `read` says of the signals of
    those that may be touches."""
    model, signal = predictor.model, volts - predictor.baseline_V
    size = np.linalg.norm(signal, axis=1)
    wild = size > WILD * predictor.novelty.strongest_V
    touched = (size >= WEAK * model.trained.weakest_V) & ~wild
    shape = (len(signal), len(model.names))
    value, below, above = (np.full(shape, np.nan) for _ in range(3))
    kinds = np.where(wild, Flag.OUTSIDE | Flag.MISFIT, np.where(touched, 0, Flag.NO_TOUCH)).astype(np.int64)
    detailed: list[dict[Flag, str]] = [{} for _ in signal]
    reverse = touched & of_other_sign(predictor.novelty, signal, predictor.noise.rms_V)
    reverse |= volts @ predictor.baseline_V < 0
    parts, several = np.full((len(signal), _force_part_count(model)), np.nan), np.zeros(len(signal), bool)
    if np.any(touched):
        found = read(signal[touched])
        strange = novelty_score(predictor.novelty, signal[touched], predictor.noise)
        off = np.column_stack([outside_range(model, found), size[touched] > STRONG * predictor.novelty.strongest_V])
        outside = off.any(axis=1) | ~found.inside
        value[touched] = found.value
        scale = predictor.scale.of(found.sd, found.near_edge)
        below[touched], above[touched] = (_widened(model, side, strange, outside)
                                          for side in found.ends(scale, normal(COVERAGE)))
        plain = np.add(*found.of_profile(scale, normal(COVERAGE)))
        several[touched] = several_answers(model, plain) & ~outside
        strange = np.maximum(strange, oddness(predictor.causes, found, model.trained.misfit))
        kinds[touched] = (Flag.OUTSIDE * outside + Flag.MISFIT * (strange > 1)
                          + Flag.OTHER_PUNCH * (found.other & ~outside))
        _name_outside(model, np.flatnonzero(touched), off, detailed)
        kinds += Flag.GAIN * _gain_named(predictor, signal, np.flatnonzero(kinds & Flag.MISFIT), detailed)
        if parts.shape[1]:
            parts[touched] = _force_parts(model, found, plain / 2 / normal(COVERAGE),
                                          (below + above)[touched] / 2 / normal(COVERAGE))
    kinds += Flag.OTHER_SIGN * reverse + Flag.SEVERAL * several
    flags = [in_words(kind, more) for kind, more in zip(kinds.tolist(), detailed, strict=True)]
    left = np.where([name in STRESSES for name in model.names], predictor.left, 1.0)
    return Predictions(value * left, below * left, above * left, flags, parts * predictor.left, kinds)


def _force_part_count(model: TrainedModel) -> int:
    """Number of parts that a model tells of the force's standard deviation."""
    return len(PARTS) if METHODS[model.method].separates_errors and "F" in model.names else 0


def _force_parts(model: TrainedModel, found: Estimate, plain: Array, sd: Array) -> Array:
    """(n, 3) parts of the force's calibrated standard deviations, of sd (n, outputs): noise and material in their
    shares of those of the trained profile, `plain` and at most the whole, and the model's the rest."""
    assert found.parts is not None
    k = model.names.index("F")
    shares = np.minimum(plain, sd)[:, k] / np.maximum(found.sd[:, k], np.finfo(float).tiny)
    noise, material = found.parts.noise[:, k] * shares, found.parts.material[:, k] * shares
    return np.column_stack([noise, material, np.sqrt(np.maximum(sd[:, k]**2 - noise**2 - material**2, 0.0))])


def _widened(model: TrainedModel, half_width: Array, strange: Array, outside: Mask) -> Array:
    """Half widths (n, outputs) of signals that are so many times as strange as trained ones, or outside their range; no
    coverage is promised there. None is wider than the range of the training."""
    factor = np.maximum(np.clip(strange, 1.0, MOST_WIDENED), np.where(outside, OUTSIDE_WIDENED, 1.0))
    span = model.trained.highest - model.trained.lowest
    punch = np.array([name not in outputs.PLACES for name in model.names])
    wide = np.maximum(half_width * factor[:, None], np.where(outside[:, None] & punch, span, 0.0))
    return np.minimum(wide, np.where(span > 0, span, np.inf))


def _name_outside(model: TrainedModel, rows: Index, off: Mask, detailed: list[dict[Flag, str]]) -> None:
    """Adds what of rows is outside the training range (n, outputs + 1), the signal's size last."""
    for row, one in zip(rows.tolist(), off, strict=True):
        if one.any():
            which = ", ".join(name for name, is_off in zip((*model.names, SIZE), one, strict=True) if is_off)
            detailed[row][Flag.OUTSIDE] = f"{WORDS[Flag.OUTSIDE]} of {which}"


def _gain_named(predictor: Predictor, signal: Array, rows: Index, detailed: list[dict[Flag, str]]) -> Mask:
    """(n,) whether the gain of one channel explains what is strange of rows; adds which."""
    named = np.zeros(len(signal), bool)
    if not len(rows) or not predictor.gains.shape[1]:
        return named
    channel, change, explains = one_column(predictor.novelty, signal[rows], predictor.gains, predictor.noise.rms_V)
    named[rows] = explains
    for row, k, by in zip(rows[explains].tolist(), channel[explains].tolist(), change[explains].tolist(), strict=True):
        detailed[row][Flag.GAIN] = f"as if the gain of channel {k} (from 0) had drifted by {100 * by:+.2g} %"
    return named


def columns(model: TrainedModel) -> list[str]:
    """Names of the columns of predictions: line, then value, lowest and highest of the 90 % interval of each output in
    its unit, parts of the force's standard deviation where the model tells them, then the flag."""
    return ["line", *_columns(model, model.units), "flag"]


def _columns(model: TrainedModel, units: Sequence[str]) -> list[str]:
    each = [f"{name}{end}_{unit}" for name, unit in zip(model.names, units, strict=True)
            for end in ("", "_lo90", "_hi90")]
    return each + [f"F_sd_{part}_N" for part in PARTS if _force_part_count(model)]


def numbers_of(model: TrainedModel, found: Predictions) -> Array:
    """(n, 3 outputs + parts) value, lowest and highest of each output, then parts, in the order of `columns`."""
    low = outputs.lowest(found.value, found.below, [name not in outputs.PLACES for name in model.names])
    ends = (found.value, low, found.value + found.above)
    return np.column_stack([np.stack(ends, axis=2).reshape(len(found.value), 3 * len(model.names)),
                            found.force_parts])


def si_table(model: TrainedModel, found: Predictions) -> pd.DataFrame:
    """One row a frame, in SI units: the columns of `columns`, line aside."""
    units, scales = zip(*(outputs.SI[unit] for unit in model.units), strict=True)
    scale = [*np.repeat(scales, 3), *np.ones(found.force_parts.shape[1])]
    return pd.DataFrame(numbers_of(model, found) * scale, columns=_columns(model, units)).assign(flag=found.flag)


def read_touches(predictor: Predictor, lines: Lines) -> Predictions:
    """Predictions of lines; one that is no frame has no values and tells why in its flag."""
    sound = np.array([not problem for problem in lines.problem], bool)
    if sound.all():
        return predict(predictor, lines.volts)
    found = predict(predictor, lines.volts[sound])
    flags, kinds = iter(found.flag), np.zeros(len(sound), np.int64)
    kinds[sound] = found.kinds

    def spread(part: Array) -> Array:
        whole = np.full((len(sound), part.shape[1]), np.nan)
        whole[sound] = part
        return whole

    return Predictions(spread(found.value), spread(found.below), spread(found.above),
                       [problem or next(flags) for problem in lines.problem], spread(found.force_parts), kinds)


def table_of(model: TrainedModel, lines: Lines, found: Predictions) -> pd.DataFrame:
    """One row a line, with the columns of `columns`; frames without a touch have no values."""
    table = pd.DataFrame(numbers_of(model, found), columns=columns(model)[1:-1]).assign(flag=found.flag)
    table.insert(0, "line", lines.line)
    return table


def sign_caution(kinds: Sequence[int] | NDArray[np.int64]) -> str:
    """In words, the likely cause of signals of the other sign, by the kinds of frames; empty where there are none."""
    count = sum(bool(kind & Flag.OTHER_SIGN) for kind in kinds)
    return "" if not count else (
        f"{count} of {len(kinds)} frames differ from the untouched one with the other sign than a touch's: were the "
        "untouched and a touched frame exchanged, or the leads of the current or of the voltmeter?")
