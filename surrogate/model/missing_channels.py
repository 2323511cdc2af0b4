"""Channels that read nothing: left out by models of the signal, filled in from the others for all other models."""

from dataclasses import replace

import numpy as np

from surrogate.data.dead_readings import Names, cost_said, none, too_many
from surrogate.data.reading_noise import ReadingNoise
from surrogate.model import sticking
from surrogate.model.trained import Calibration, TrainedModel, estimate
from surrogate.recordings.dead_channels import MOST_KEPT, filled, filled_without, learn_readings
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Mask

DEAD = 1e-9  # a reading this far below the RMS of its frame reads nothing
CALIBRATION_ROWS = 100  # validation rows that calibrate the intervals of a model without some readings
COST_ROWS = 20  # of these, that tell what being without them costs


def silent(volts: Array, baseline_V: Array) -> Mask:
    """(n, readings) channels of frames (n, readings), V, that read nothing where the baseline (readings,), V, of the
    training does, or that are no number that an instrument reads."""
    unread = none(volts)
    finite = np.where(unread, 0.0, volts)
    size, known = (np.sqrt(np.mean(v**2, axis=-1, keepdims=True)) for v in (finite, baseline_V))
    return unread | ((np.abs(finite) <= DEAD * size) & (np.abs(baseline_V) > DEAD * known))


def stuck(volts: Array) -> Mask:
    """(readings,) channels that read exactly the same in all of three or more frames (n, readings), while nine in ten
    others change; cells without a number aside."""
    finite = np.isfinite(volts)
    same = np.min(volts, axis=0, initial=np.inf, where=finite) == np.max(volts, axis=0, initial=-np.inf, where=finite)
    same &= finite.sum(axis=0) > 2
    return same if np.mean(same) < sticking.MOST else np.zeros_like(same)


def named(dead: Mask) -> str:
    """In words, which channels of a mask (readings,) are dead, counted from 1."""
    columns = [str(column + 1) for column in np.flatnonzero(dead)]
    first = ", ".join(columns[:4]) + (f" and {len(columns) - 4} more" if len(columns) > 4 else "")
    return f"dead channel: column {first}" if len(columns) == 1 else f"dead channels: columns {first}"


def check_enough(dead: Mask, where: str) -> None:
    """ValueError where too many channels (readings,) are dead in every frame, as of a file."""
    if problem := too_many(dead):
        raise ValueError(f"{where}: {named(dead)}, so that no frame can be read: {problem}.")


def without(model: TrainedModel, dead: Mask) -> TrainedModel:
    """What reads frames without these channels (readings,), its intervals to be calibrated on validation rows that lack
    them too: on the others alone, or on all where its method needs these, filled in."""
    fewer = of_fewer(model, dead)
    if (learner := model.learner.without(model.ring, fewer.ring, ~dead)) is not None:
        return replace(fewer, learner=learner)
    rows = spread_evenly(len(model.calibration.target), MOST_KEPT)
    return replace(model, calibration=Calibration(
        filled_without(learn_readings(model.calibration.signal_V), dead), model.calibration.target[rows],
        model.calibration.signal_sd[rows]))


def cost_words(model: TrainedModel, dead: Mask, noise: ReadingNoise, columns: Names) -> str:
    """In words, which channels a mask (readings,) names, and the mean error of each output without and with them, of
    validation rows with this noise."""
    fewer = without(model, dead)
    kept = np.ones(len(dead), bool) if fewer.readings == len(dead) else ~dead
    rows, calibration = spread_evenly(len(model.calibration.target), CALIBRATION_ROWS), fewer.calibration
    some = spread_evenly(len(rows), COST_ROWS)
    added = noise.draws(len(some), np.random.default_rng(model.seed))
    target = calibration.target[some]
    left, whole = (np.abs(estimate(one, signal + drawn, known).value - target) for one, signal, drawn, known in (
        (fewer, calibration.signal_V[some], added[:, kept], noise.of(kept)),
        (model, model.calibration.signal_V[rows[some]], added, noise)))
    return cost_said(dead, "validation rows", {
        name: (float(left[:, k].mean()), float(whole[:, k].mean()), unit)
        for k, (name, unit) in enumerate(zip(model.names, model.units, strict=True))}, columns)


def filled_in(model: TrainedModel, signal_V: Array) -> Array:
    """Signals (n, readings), V, with NaN replaced by what validation rows say of it with the other readings."""
    return filled(learn_readings(model.calibration.signal_V), signal_V)


def of_fewer(model: TrainedModel, dead: Mask) -> TrainedModel:
    """What a model knows of the channels (readings,) that are left, but for its learner, which is that of all."""
    kept = ~dead
    rows = spread_evenly(len(model.calibration.target), CALIBRATION_ROWS)
    calibration = Calibration(model.calibration.signal_V[rows][:, kept], model.calibration.target[rows],
                              model.calibration.signal_sd[rows])
    whole = model.ring
    ring = replace(whole, source=whole.source[kept], sink=whole.sink[kept], read=whole.read[kept],
                   ground=whole.ground[kept])
    weakest = model.trained.weakest_V * float(np.sqrt(np.mean(kept)))
    return replace(model, ring=ring, calibration=calibration, baseline_V=model.baseline_V[kept],
                   trained=replace(model.trained, weakest_V=weakest))
