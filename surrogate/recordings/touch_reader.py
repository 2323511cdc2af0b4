"""Places read from signals by several families, combined by what each did on held-out blocks in time."""

from dataclasses import dataclass

import numpy as np

from surrogate.recordings import kernel_ridge, networks, stacking, templates
from surrogate.recordings.baselines import without
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.intervals import Intervals, calibrated
from surrogate.recordings.kernel_ridge import KernelRidge
from surrogate.recordings.late_readings import late_readings
from surrogate.recordings.networks import Networks
from surrogate.recordings.patterns import Features, learn_features
from surrogate.recordings.physics.expectation import Expectation
from surrogate.recordings.presses import Presses, cut
from surrogate.recordings.signals import Signals, learn_signals
from surrogate.recordings.templates import Templates
from surrogate.recordings.waves import Waves, draw_waves
from surrogate.recordings.worth import check_worth, distance
from touchcal.arrays import Array, Mask

FAMILIES = ("kernel ridge", "templates of direction", "templates of readings", "networks", "networks on templates",
            "corrected templates")
# Directions of drift that may be projected out of all signals, and those that are where the untouched frame is old.
PROJECTED, PROJECTED_OLD = (0, 3, 6), 6
STRANGE = 1.5  # times the greatest misfit of held-out presses: a signal further from all templates is flagged


@dataclass(frozen=True, eq=False)
class TouchReader:
    """A trained reader of places."""

    signals: Signals
    projected: int  # directions of drift taken out of signals
    ridge: KernelRidge
    direction: Templates
    compressed: Templates
    features: Features  # inputs of networks
    waves: Waves  # of the places by both templates: further inputs of the networks on templates
    networks: Networks
    on_templates: Networks
    correction: Networks  # of the place by the templates of readings
    old: Templates  # of signals with PROJECTED_OLD directions taken out
    weights: Array  # (families,) in the order of FAMILIES
    intervals: Intervals
    of_cut: Intervals  # of frames whose late readings are not there, by the networks
    greatest_misfit: float  # of a held-out press from the templates of direction
    held_out: Array  # (families + 2,) mean held-out distance of each family, of all combined and of the mean, mm


@dataclass(frozen=True, eq=False)
class Reading:
    """Places of some frames."""

    value: Array  # (n, 2) mm
    half_width: Array  # (n, 2) half width of the 90 % interval, mm
    strange: Mask  # (n,) whether the pattern is unlike those of the training presses


@dataclass(frozen=True, eq=False)
class Learnt:
    """A reader of places, and what it says of training presses that were held out."""

    reader: TouchReader
    place: Array  # (n, 2) mm
    cut_place: Array  # (n, 2) mm, without the frames that follow, by the networks


def fit(presses: Presses, place: Array, seed: int = 0) -> TouchReader:
    """Learn places (n, 2), mm, from presses in time order; errors as `learn`."""
    return learn(presses, place, learn_signals(presses, late_readings(presses.signal, presses.following, place)),
                 seed).reader


def learn(presses: Presses, place: Array, known: tuple[Signals, Array], seed: int,
          expectation: Expectation | None = None) -> Learnt:
    """Learn places (n, 2), mm, from presses in time order, from what is known of their signals and what a model of the
    sensor expects of them; NothingToRead where held-out presses are read no better than by the mean place."""
    (signals, signal), drift = known, known[0].drift
    blocks = time_blocks(len(place))
    columns = np.append(np.arange(signals.channels), signals.late)
    priors = (templates.nothing, *([expectation.taking(columns).learn] if expectation else []))
    projected, direction = min(
        ((count, templates.fit(without(drift, signal, count), place, blocks, compress=False)) for count in PROJECTED
         if count <= len(drift.root) // 2 or not count),
        key=lambda one: distance(one[1].place, place))
    kept = without(drift, signal, projected)
    if expectation:
        direction = templates.fit(kept, place, blocks, compress=False, priors=priors)
    ridge = kernel_ridge.fit(kept, place)
    compressed = templates.fit(kept, place, blocks, compress=True, priors=priors)
    features, waves = learn_features(kept), draw_waves(place, seed)
    inputs = features.of(kept)
    ensemble, of_networks = networks.fit(inputs, place, blocks, seed)
    further = np.hstack([inputs, waves.of(direction.place), waves.of(compressed.place)])
    on_templates, refined = networks.fit(further, place, blocks, seed + 1)
    correction, missing = networks.fit(further, place - compressed.place, blocks, seed + 2)
    each = np.stack([kernel_ridge.held_out(ridge, kept, place, blocks), direction.place, compressed.place,
                     of_networks, refined, compressed.place + missing])
    weights = stacking.weights(each, place)
    value, of_each = stacking.combined(each, place, blocks)
    spread = _spread(of_each, each, value, direction.sd, compressed.sd)
    mean = np.broadcast_to(place.mean(axis=0), place.shape)
    check_worth(value, mean, place, "the place", "mm")
    old = (templates.fit(without(drift, signal, PROJECTED_OLD), place, blocks, compress=False, priors=priors)
           if len(drift.root) else direction)
    of_cut = networks.held_out(ensemble, features.of(without(drift, signals.whole(cut(presses)), projected)), blocks)
    reader = TouchReader(signals, projected, ridge, direction.templates, compressed.templates, features, waves,
                         ensemble, on_templates, correction, old.templates, weights,
                         calibrated(value - place, spread), calibrated(of_cut - place, np.zeros_like(place)),
                         float(direction.misfit.max()),
                         np.array([distance(one, place) for one in (*each, value, mean)]))
    return Learnt(reader, value, of_cut)


def read(reader: TouchReader, presses: Presses) -> Reading:
    """Places of presses with their intervals and flags.

    Where the frame that follows should hold readings of a press and is not there, intervals are those of the networks
    on presses that lack it. Where the untouched frame is far older than in training, templates of the signal without
    the main directions of drift read the place; intervals then do not hold, which the flag says.
    """
    signals = reader.signals
    signal, old = signals.whole(presses), signals.old(presses)
    kept = without(signals.drift, signal, reader.projected)
    direction, compressed = reader.direction.read(kept), reader.compressed.read(kept)
    inputs = reader.features.of(kept)
    further = np.hstack([inputs, reader.waves.of(direction[0]), reader.waves.of(compressed[0])])
    each = np.stack([reader.ridge.read(kept), direction[0], compressed[0],
                     reader.networks.read_each(inputs).mean(axis=0),
                     reader.on_templates.read_each(further).mean(axis=0),
                     compressed[0] + reader.correction.read_each(further).mean(axis=0)])
    value = np.tensordot(reader.weights, each, 1)
    spread = _spread(np.tile(reader.weights, (len(value), 1)), each, value, direction[1], compressed[1])
    if old.any():
        value[old], spread[old], _ = reader.old.read(without(signals.drift, signal[old], PROJECTED_OLD))
    half_width = reader.intervals.half_width(spread)
    half_width[signals.cut(presses) & ~old] = reader.of_cut.half_width(np.zeros((1, 2)))
    return Reading(value, half_width, direction[2] > STRANGE * reader.greatest_misfit)


def _spread(weights: Array, each: Array, value: Array, direction_sd: Array, compressed_sd: Array) -> Array:
    """(n, 2) how far places (families, n, 2) of weights (n, families) lie from their mean (n, 2), with what the
    templates leave open."""
    variance = np.einsum("nf,fnk->nk", weights, (each - value) ** 2)
    return np.sqrt(variance + weights[:, [1]] * direction_sd**2 + weights[:, [2]] * compressed_sd**2)
