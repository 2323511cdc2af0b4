"""Touches from recorded frames: values, 90 % intervals and flags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from eitsim.frames import Frames
from surrogate.estimate import Estimate
from surrogate.model import Model, estimate, interval_scale

Array = NDArray[np.float64]

NO_TOUCH, OUTSIDE, MISFIT = "no touch", "outside the training range", "unlike the trained touches"
# A signal below this part of the weakest training signal is no touch.
WEAK = 0.5
# How far beyond the training targets, in their ranges, a value may lie before it is flagged.
SLACK = 0.02
# Misfit from which a frame is unlike a touch: this many times the worst of the validation rows.
MISFIT_FACTOR = 3.0


@dataclass(frozen=True)
class Untouched:
    """The frame that signals are differences to."""

    # (readings,) V
    volts: Array
    # standard deviation of one reading of a touched frame minus this one, V; None where one frame cannot tell
    noise_V: float | None


def untouched(frames: Frames) -> Untouched:
    """The mean of untouched frames, and the noise by their scatter where there are two or more."""
    n = len(frames.volts)
    noise = float(np.sqrt(np.mean(frames.volts.var(axis=0, ddof=1)) * (1 + 1 / n))) if n > 1 else None
    return Untouched(frames.volts.mean(axis=0), noise)


def predict_frames(model: Model, frames: Frames, reference: Untouched, noise_V: float = 0.0) -> pd.DataFrame:
    """One row a frame: line, then value, lowest and highest of the 90 % interval for each output, then the flag.

    Frames without a touch have no values. Columns carry the outputs' units.
    """
    signal = frames.volts - reference.volts
    touched = np.linalg.norm(signal, axis=1) >= WEAK * model.trained.weakest_V
    shape = (len(signal), len(model.names))
    value, half_width, flags = np.full(shape, np.nan), np.full(shape, np.nan), np.full(len(signal), NO_TOUCH, object)
    if np.any(touched):
        found = estimate(model, signal[touched], noise_V)
        value[touched], half_width[touched] = found.value, found.sd * interval_scale(model, noise_V)
        flags[touched] = _flags(model, found)
    table = pd.DataFrame({"line": frames.line})
    for k, (name, unit) in enumerate(zip(model.names, model.units, strict=True)):
        table[f"{name}_{unit}"] = value[:, k]
        table[f"{name}_lo90_{unit}"] = value[:, k] - half_width[:, k]
        table[f"{name}_hi90_{unit}"] = value[:, k] + half_width[:, k]
    table["flag"] = flags
    return table


def _flags(model: Model, found: Estimate) -> list[str]:
    slack = SLACK * (model.trained.highest - model.trained.lowest)
    beyond = (found.value < model.trained.lowest - slack) | (found.value > model.trained.highest + slack)
    outside = beyond.any(axis=1) | ~found.inside
    odd = found.misfit > MISFIT_FACTOR * max(model.trained.misfit, 1.0)
    return ["; ".join([OUTSIDE] * bool(b) + [MISFIT] * bool(o)) for b, o in zip(outside, odd, strict=True)]
