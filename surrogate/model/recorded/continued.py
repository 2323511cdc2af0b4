"""A reader of one session continued in another, by a few labelled presses of the second.

What may have changed is found in turn: gains of readings, in proportion to the untouched frames where that explains the
presses better; where the skin lies on the table; the gain of all readings; what is added to the patterns, and in which
directions they scatter; how far families may be trusted. Each press is then read by what the others teach: weights,
intervals and flags are those of these readings. Estimates of few numbers are drawn to no change as far as chance
explains them (James and Stein, Estimation with quadratic loss, 1961).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from eitsim.sensors.labels import PLACE, Labels
from surrogate.recordings import press_reader, stacking, touch_reader
from surrogate.recordings.baselines import without
from surrogate.recordings.press_reader import PressReader
from surrogate.recordings.presses import Presses, taken, whole_rest
from surrogate.recordings.session.motion import Motion, find_motion
from surrogate.recordings.signals import Signals
from surrogate.recordings.templates import Templates
from surrogate.recordings.worth import distance
from surrogate.statistics.conformal import MEAN_ERRORS, Intervals, of_few
from surrogate.statistics.unlikeness import Unlikeness
from touchcal.arrays import Array

FEWEST = 5  # labelled presses of the second session
SMALL = 0.05  # of the median untouched reading: a smaller one says nothing of a gain
SURE = 3.0  # standard errors that a gain of all readings must exceed, for force and depth change sizes as well
# Weights before any press where patterns are other ones, over the squared errors of the first session: what scatters is
# known to templates, and to networks that go on from them.
PRIOR = np.array([0.05, 0.3, 0.3, 0.05, 0.15, 0.3])
LEAST = 0.02  # weight of any family before
PRIOR_PRESSES = 3.0  # presses that intervals as wide as in the first session are worth


@dataclass(frozen=True, eq=False)
class Continued:
    """A reader of the second session, and what five presses say of it, each read by what the others teach."""

    reader: PressReader
    before_mm: float  # mean distance of the labelled presses as the reader of the first session has them
    after_mm: float  # likewise of readers continued without each
    widening: float  # factor of the intervals of places


def continued(reader: PressReader, presses: Presses, labels: Labels) -> Continued:
    """The reader in another session of the skin, by labelled presses of it, one frame each; ValueError where these are
    fewer than FEWEST, or where reader or labels have no place."""
    if reader.place is None or not {*PLACE} <= {*labels.names}:
        raise ValueError("another session is learnt from places: give x_mm and y_mm, and a model that reads them.")
    if len(presses.name) < FEWEST:
        raise ValueError(f"{len(presses.name)} labelled presses of the second session are too few; give {FEWEST} or "
                         "more, spread over the skin.")
    place = np.stack([labels.values[:, labels.names.index(name)] for name in PLACE], axis=1)
    rows = np.arange(len(place))
    others = [_fitted(reader, taken(presses, rows[rows != one]), place[rows != one]) for one in rows]
    whole = _fitted(reader, presses, place)
    alone = [taken(presses, np.array([one])) for one in rows]
    each, along = np.empty((len(reader.place.weights), *place.shape)), np.empty((len(place), 2, 2))
    for row, (part, press) in enumerate(zip(others, alone, strict=True)):
        one, direction, compressed = _families(part, press)
        each[:, row] = one[:, 0] if part.motion is None else part.motion.of(one[:, 0])
        along[row] = np.concatenate(touch_reader.misfits(direction, compressed))
    weights = stacking.weights(each, place, _prior(replace(reader, signals=whole.signals), presses), len(place))
    unlike = [_rescaled(one, along[:, which]) for which, one in enumerate((reader.place.whole, reader.place.along))]
    others = [_with(part, weights=weights, whole=unlike[0], along=unlike[1]) for part in others]
    found = [press_reader.read(part, press) for part, press in zip(others, alone, strict=True)]
    value = np.concatenate([one.place.value for one in found if one.place])
    half = np.concatenate([one.place.bounds.half_width for one in found if one.place])
    factor = _factor((value - place) / half, len(place))
    scalars = tuple(replace(one, shift=np.array([shift]), intervals=_scaled(one.intervals, wider),
                            of_cut=_scaled(one.of_cut, wider))
                    for number, one in enumerate(reader.scalars)
                    for shift, wider in [label_shift(one.name, labels, [press.scalars[number] for press in found])])
    old = whole.place.of_old if whole.place else reader.place.of_old
    made = _with(whole, weights=weights, whole=unlike[0], along=unlike[1],
                 intervals=_scaled(reader.place.intervals, factor), of_cut=_scaled(reader.place.of_cut, factor),
                 of_old=replace(old, intervals=tuple(_scaled(one, factor) for one in old.intervals)))
    before = press_reader.read(reader, presses).place
    assert before
    return Continued(replace(made, scalars=scalars), distance(before.value, place), distance(value, place), factor)


def _prior(reader: PressReader, presses: Presses) -> Array:
    """(families,) weights in another session before any place of its presses is known: those of the first session, as
    far as patterns miss the templates by no more than there."""
    touch = reader.place
    assert touch
    _, direction, compressed = _families(reader, presses)
    missed = np.median(touch_reader.misfits(direction, compressed)[0], axis=0)
    same = float(np.min(np.minimum(touch.whole.middle / missed, 1.0)))
    other = PRIOR[:len(touch.weights)] / np.square(touch.held_out[:len(touch.weights)])
    return np.maximum(same * touch.weights + (1 - same) * other / other.sum(), LEAST)


def _families(reader: PressReader, presses: Presses) -> tuple[Array, tuple[Array, ...], tuple[Array, ...]]:
    assert reader.place
    kept = without(reader.signals.drift, reader.signals.whole(presses), reader.place.projected)
    return touch_reader.each_family(reader.place, kept)


def _with(reader: PressReader, **parts: object) -> PressReader:
    assert reader.place
    return replace(reader, place=replace(reader.place, **parts))


def _fitted(reader: PressReader, presses: Presses, place: Array) -> PressReader:
    """Gains, motion and patterns of the session of presses at places (k, 2), mm."""
    touch = reader.place
    assert touch
    tried = [_moved(replace(reader, signals=signals), presses, place) for signals in _gains(reader.signals, presses)]
    signals, motion, _ = max(tried, key=lambda one: one[2])
    at = place if motion is None else motion.back(place)
    kept = without(signals.drift, signals.whole(presses), touch.projected)
    trained = without(signals.drift, signals.readings.kept, touch.projected)
    signals = _amplified(signals, _gain(touch.compressed, kept, at, trained))
    seen = signals.whole(presses)
    kept, spared = (without(signals.drift, seen, some) for some in (touch.projected, touch.spared))
    direction, compressed, old = (_shifted(one, signal, at) for one, signal in (
        (touch.direction, kept), (touch.compressed, kept), (touch.old, spared)))
    return replace(reader, signals=signals, motion=motion, place=replace(
        touch, signals=signals, direction=direction, compressed=compressed, old=old))


def _gains(signals: Signals, presses: Presses) -> list[Signals]:
    """Signals of the session as they are, and with each reading in proportion to its untouched one."""
    presses = whole_rest(presses)
    if not len(presses.rest):
        return [signals]
    rest = np.where(np.isnan(signals.rest), np.nan, presses.rest.mean(axis=0))
    known = replace(signals, rest=rest)
    sound = np.minimum(np.abs(rest), np.abs(signals.rest)) > SMALL * np.nanmedian(np.abs(signals.rest))
    gain = np.where(sound, np.divide(signals.rest, rest, out=np.ones_like(rest), where=sound), 1.0)
    return [known, _amplified(known, np.append(gain, gain[signals.late]))]


def _amplified(signals: Signals, gain: Array | float) -> Signals:
    """Signals whose readings are multiplied by these gains as well."""
    one = np.ones(len(signals.readings.mean)) if signals.gain is None else signals.gain
    return replace(signals, gain=one * gain)


def _moved(reader: PressReader, presses: Presses, place: Array) -> tuple[Signals, Motion | None, float]:
    """How the skin lies, by the places of all families, and how likely."""
    touch, prior = reader.place, _prior(reader, presses)
    assert touch
    read = np.tensordot(prior / prior.sum(), _families(reader, presses)[0], 1)
    grid = touch.direction.places
    radius = float(np.linalg.norm(grid - grid.mean(axis=0), axis=1).max())
    motion, score = find_motion(read, place, radius, float(touch.held_out[1:3].mean()) / np.sqrt(2))
    return reader.signals, motion, score


def _gain(templates: Templates, signal: Array, place: Array, trained: Array) -> float:
    """The factor that brings signals (k, m) at places (k, 2) to the size of trained ones (n, m), each over the
    template of its place, drawn to 1."""
    apart, usual = _sizes(templates, signal, place), _sizes(templates, trained, templates.read(trained)[0])
    change, chance = float(usual.mean() - apart.mean()), max(usual.var(ddof=1), apart.var(ddof=1)) / len(apart)
    return float(np.exp(change * _sure(change**2, SURE**2 * float(chance))))


def _sizes(templates: Templates, signal: Array, place: Array) -> Array:
    """(k,) logarithms of the sizes of signals (k, m) over those of the templates at places (k, 2)."""
    expected = templates.view.scale * np.sinh(_at(templates, place))
    return np.log(np.linalg.norm(signal, axis=1) / np.linalg.norm(expected, axis=1))


def _shifted(templates: Templates, signal: Array, place: Array) -> Templates:
    """Templates with what presses of signals (k, m) at places (k, 2) add to all of them, and with their scatter."""
    left = templates.view.of(signal) - _at(templates, place)
    mean = left.mean(axis=0)
    seen = np.linalg.solve(templates.factor, np.stack([mean, *(left - mean)]).T).T
    share = _sure(float(np.sum(seen[0] ** 2)), float(np.sum(seen[1:] ** 2)) / (len(left) - 1) / len(left))
    left = left - share * mean
    return replace(templates, pattern=templates.pattern + share * mean,
                   covariance=templates.covariance + left.T @ left / len(left))


def _at(templates: Templates, place: Array) -> Array:
    """(k, m) templates nearest to places (k, 2)."""
    return templates.pattern[np.array([np.sum((templates.places - one) ** 2, axis=1).argmin() for one in place])]


def _sure(square: float, chance: float) -> float:
    """Part of an estimate whose square exceeds what chance makes of it."""
    return max(1 - chance / max(square, np.finfo(float).tiny), 0.0)


def _rescaled(unlikeness: Unlikeness, misfit: Array) -> Unlikeness:
    """What misfits (k, 2) of presses of the session make of those that are usual; never less."""
    factor = max(float(np.exp(np.mean(np.log(misfit / unlikeness.middle)))), 1.0)
    return replace(unlikeness, usual=factor * unlikeness.usual, most=factor * unlikeness.most,
                   middle=factor * unlikeness.middle, rows=len(misfit))


def _factor(ratio: Array, presses: int) -> float:
    """Factor of intervals by errors over their half widths (k, ...), drawn to 1 and never less; of few errors as much
    wider as Student's t is than the normal distribution."""
    mean = MEAN_ERRORS * float(np.mean(np.abs(ratio)))
    return of_few(ratio.size) * max(mean ** (presses / (presses + PRIOR_PRESSES)), 1.0)


def _scaled(intervals: Intervals, factor: float) -> Intervals:
    return replace(intervals, factor=factor * intervals.factor)


def label_shift(name: str, labels: Labels, found: list[press_reader.ScalarReading]) -> tuple[float, float]:
    """What is added to a label and the factor of its intervals; none where the presses do not state it."""
    if name not in labels.names:
        return 0.0, 1.0
    error = labels.values[:, labels.names.index(name)] - np.concatenate([one.value for one in found])
    half = np.concatenate([one.half_width for one in found])
    shift = float(error.mean()) * _sure(float(error.mean() ** 2), float(error.var(ddof=1)) / len(error))
    return shift, _factor((error - shift) / half, len(error))
