"""Places read from signals by several families, combined by what each did on held-out blocks in time."""

from dataclasses import dataclass

import numpy as np

from surrogate.recordings import kernel_ridge, place_networks, stacking, templates
from surrogate.recordings.ageing import HeldOut, Known, OldReadings, calibrated_by_age
from surrogate.recordings.baselines import without
from surrogate.recordings.blocks import press_blocks
from surrogate.recordings.kernel_ridge import KernelRidge
from surrogate.recordings.physics.expectation import Expectation
from surrogate.recordings.place_networks import PlaceNetworks
from surrogate.recordings.presses import Presses, cut
from surrogate.recordings.signals import Signals
from surrogate.recordings.templates import Fitted, Templates
from surrogate.recordings.worth import check_worth, distance
from surrogate.statistics.conformal import FEW, Bounds, Intervals, calibrated, chosen, widened
from surrogate.statistics.nearness import Nearness, learn_nearness
from surrogate.statistics.unlikeness import Unlikeness, learn_unlikeness
from touchcal.arrays import Array, Index, Mask

FAMILIES = ("kernel ridge", "templates of direction", "templates of readings", *place_networks.FAMILIES)
PRIOR = np.array([0.15, 0.5, 0.3, 0.15, 0.15, 0.15])  # weights before any press is held out, up to a factor
PROJECTED = (0, 3, 6)  # directions of drift that may be projected out of signals


@dataclass(frozen=True, eq=False)
class TouchReader:
    """A trained reader of places."""

    signals: Signals
    projected: int  # directions of drift taken out of signals
    spared: int  # likewise, where the untouched frame is old
    ridge: KernelRidge
    direction: Templates
    compressed: Templates
    networks: PlaceNetworks | None  # None of fewer than FEW presses, of which they learn less than the others
    old: Templates  # of signals where the untouched frame is old
    weights: Array  # (families,) in the order of FAMILIES
    intervals: Intervals
    of_cut: Intervals  # of frames whose late readings are not there
    of_old: OldReadings  # of frames whose untouched frame is old, by the old templates
    whole: Unlikeness  # by the squared distances from the templates of direction and of readings
    along: Unlikeness  # likewise, along the directions of touches, which move the place
    near: Nearness  # to the training presses, by the view of the templates of direction
    held_out: Array  # (families + 2,) mean held-out distance of each family, of all combined and of the mean, mm


@dataclass(frozen=True, eq=False)
class Reading:
    """Places of some frames."""

    value: Array  # (n, 2) mm
    bounds: Bounds  # mm
    strange: Mask  # (n,) whether the pattern is unlike those of the training presses
    widening: Array  # (n,) factor of intervals that comes of unlike and of distant patterns


def learn(presses: Presses, place: Array, press: Index, known: Known, seed: int,
          expectation: Expectation | None = None) -> tuple[TouchReader, HeldOut]:
    """Learn places (n, 2), mm, from frames in time order of presses (n,), from what is known of their signals and what
    a model of the sensor expects of them; NothingToRead where held-out presses are read no better than by the mean
    place."""
    signals, signal, drift = known.signals, known.signal, known.signals.drift
    blocks, count = press_blocks(press), int(press.max()) + 1
    columns = np.append(np.arange(signals.channels), signals.late)
    priors = (templates.nothing, *(expectation.taking(columns).priors if expectation else ()))
    fits = {directions: templates.fit(without(drift, signal, directions), place, blocks, compress=False,
                                 seen=tuple(without(drift, one.signal, directions) for one in known.aged), press=press)
            for directions in PROJECTED if directions <= len(drift.root)}
    projected = min((some for some in fits if some <= len(drift.root) // 2),
                    key=lambda some: distance(fits[some].place, place))
    spared = min(fits, key=lambda some: _aged_distance(known, fits[some], place)) if known.aged else max(fits)
    direction, old = fits[projected], fits[spared]
    kept = without(drift, signal, projected)
    if expectation:
        direction = templates.fit(kept, place, blocks, compress=False, priors=priors, press=press)
    ridge = kernel_ridge.fit(kept, place, press)
    gone = without(drift, signals.whole(cut(presses)), projected)
    compressed = templates.fit(kept, place, blocks, compress=True, priors=priors, press=press, seen=(gone,))
    learnt, of_networks = (place_networks.fit(kept, place, direction.place, compressed.place, blocks, seed)
                           if count >= FEW else (None, []))
    each = np.stack([kernel_ridge.held_out(ridge, kept, place, blocks), direction.place, compressed.place,
                     *of_networks])
    prior = PRIOR[:len(each)]
    weights = stacking.weights(each, place, prior, count)
    value, of_each = stacking.combined(each, place, prior, blocks, press)
    spread = _spread(of_each, each, value, direction.sd, compressed.sd)
    cross = _cross(of_each, each, value)
    mean = np.broadcast_to(place.mean(axis=0), place.shape)
    check_worth(value, mean, place, press, "the place", "mm")
    whole, along = (np.stack([direction.misfit[:, k], compressed.misfit[:, k]], axis=1) for k in (0, 1))
    near, wider = learn_nearness(direction.templates.view.of(kept), blocks)
    wider = wider * learn_unlikeness(along).widening(along)
    of_cut = learnt.held_out(gone, blocks) if learnt else compressed.seen[0][0]
    of_old = calibrated_by_age(known.aged, place, (old.place, old.sd), old.seen, press)
    reader = TouchReader(signals, projected, spared, ridge, direction.templates, compressed.templates, learnt,
                         old.templates, weights,
                         calibrated((value - place) / wider[:, None], spread, cross, count),
                         calibrated(of_cut - place, np.zeros_like(place), np.zeros(len(place)), count),
                         of_old, learn_unlikeness(whole), learn_unlikeness(along), near,
                         np.array([distance(one, place) for one in (*each, value, mean)]))
    fresh, *aged = (of_old.mean + gain * (one - of_old.mean)
                    for gain, one in zip(of_old.gain, (old.place, *(one for one, _ in old.seen)), strict=True))
    return reader, HeldOut(value, of_cut, fresh, tuple(aged), wider)


def read(reader: TouchReader, presses: Presses) -> Reading:
    """Places of presses with their intervals and flags.

    Where the frame that follows should hold readings of a press and is not there, intervals are those of the networks,
    or of the templates of readings, on presses that lack it. Intervals are wider where patterns are far from those
    taught, and where they fit the templates less well than in training, frame by frame and, of frames that are read
    together, all in all. Where the untouched frame
    is far older than in training, templates of the signal without the main directions of drift read the place;
    intervals are those of presses against frames as old, as far as training could show them.
    """
    signals = reader.signals
    signal, old = signals.whole(presses), signals.spared(presses)
    kept = without(signals.drift, signal, reader.projected)
    each, direction, compressed = each_family(reader, kept)
    value = np.tensordot(reader.weights, each, 1)
    spread = _spread(np.tile(reader.weights, (len(value), 1)), each, value, direction[1], compressed[1])
    whole, along = misfits(direction, compressed)
    wider = reader.along.of_session(along, along[~old])
    wider = wider * reader.near.widening(reader.direction.view.of(kept))
    bounds = reader.intervals.bounds(spread, _cross(np.tile(reader.weights, (len(value), 1)), each, value))
    none = np.zeros_like(value)
    bounds = widened(chosen(signals.cut(presses), reader.of_cut.bounds(none, none[:, 0]), bounds), wider)
    if old.any():
        there, sd, _ = reader.old.read(without(signals.drift, signal, reader.spared))
        there, of_old = reader.of_old.read(presses.age, there, sd)
        value, bounds = np.where(old[:, None], there, value), chosen(old, of_old, bounds)
    return Reading(value, bounds, reader.whole.odd(whole) | reader.along.odd(along), wider)


def each_family(reader: TouchReader, kept: Array) -> tuple[Array, tuple[Array, ...], tuple[Array, ...]]:
    """(families, n, 2) places of signals (n, m) that drift spares, and what both templates read of them."""
    direction, compressed = reader.direction.read(kept), reader.compressed.read(kept)
    networks = reader.networks.read(kept, direction[0], compressed[0]) if reader.networks else ()
    return np.stack([reader.ridge.read(kept), direction[0], compressed[0], *networks]), direction, compressed


def misfits(direction: tuple[Array, ...], compressed: tuple[Array, ...]) -> tuple[Array, Array]:
    """(n, 2) misfits of what both templates read, in all and along the directions of touches."""
    whole, along = (np.stack([direction[2][:, k], compressed[2][:, k]], axis=1) for k in (0, 1))
    return whole, along


def _aged_distance(known: Known, fitted: Fitted, place: Array) -> float:
    """Mean distance of what is read of held-out presses against older untouched frames, over the ages."""
    return float(np.mean([distance(value[one.rows], place[one.rows])
                          for one, (value, _) in zip(known.aged, fitted.seen, strict=True)]))


def _spread(weights: Array, each: Array, value: Array, direction_sd: Array, compressed_sd: Array) -> Array:
    """(n, 2) how far places (families, n, 2) of weights (n, families) lie from their mean (n, 2), with what the
    templates leave open."""
    variance = np.einsum("nf,fnk->nk", weights, (each - value) ** 2)
    return np.sqrt(variance + weights[:, [1]] * direction_sd**2 + weights[:, [2]] * compressed_sd**2)


def _cross(weights: Array, each: Array, value: Array) -> Array:
    """(n,) covariance of x and y among places (families, n, 2) of weights (n, families) about their mean (n, 2)."""
    return np.einsum("nf,fn->n", weights, np.prod(each - value, axis=2))
