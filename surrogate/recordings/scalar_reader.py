"""One label read from signals: the depth, the force or the diameter of a press, or one coordinate of it.

At a known place the depth of a press is mostly the size of its signal, so that what the reader of places says of a
press is an input, next to log |s|. Families are combined by what each did on held-out blocks in time.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.sensors.labels import unit_of
from surrogate.recordings import kernel_ridge, networks, stacking
from surrogate.recordings.ageing import HeldOut, Known, OldReadings, calibrated_by_age
from surrogate.recordings.baselines import without
from surrogate.recordings.blocks import press_blocks
from surrogate.recordings.kernel_ridge import KernelRidge
from surrogate.recordings.networks import Networks
from surrogate.recordings.patterns import Features, learn_features
from surrogate.recordings.worth import check_worth, distance
from surrogate.statistics.conformal import Bounds, Intervals, calibrated
from surrogate.statistics.unlikeness import Unlikeness, learn_unlikeness
from touchcal.arrays import Array, Index

FAMILIES = ("kernel ridge", "kernel ridge on place and size", "networks on place and size")
EPOCHS = 60  # of the networks
NEAR = 3.0  # factor of place and size among the inputs of networks: each counts as several inputs


@dataclass(frozen=True, eq=False)
class Context:
    """What is known of presses before a label is read: [x, y, log |s|], or log |s| alone."""

    mean: Array  # (q,) over the training presses
    spread: Array  # (q,)

    def of(self, signal: Array, place: Array | None) -> Array:
        """(n, q) standardised, of signals (n, m) at places (n, 2) as read, in mm."""
        return (_context(signal, place) - self.mean) / self.spread


@dataclass(frozen=True, eq=False)
class ScalarReader:
    """A trained reader of one label."""

    name: str  # of the label
    context: Context
    features: Features
    ridge: KernelRidge  # of signals
    sized: KernelRidge  # of the context
    networks: Networks  # of features and context
    old: KernelRidge  # of the context of signals that drift spares
    weights: Array  # (families,) in the order of FAMILIES
    unlikeness: Unlikeness  # by the squared distance from the nearest training signal
    intervals: Intervals
    of_cut: Intervals  # of frames whose late readings are not there, by the networks
    of_old: OldReadings  # of frames whose untouched frame is old
    held_out: Array  # (families + 2,) mean held-out error of each family, of all combined and of the mean
    shift: Array | None = None  # (1,) what another session adds to the label


def fit(name: str, label: Array, press: Index, known: Known, lacking: Array, taken_out: tuple[int, int],
        place: HeldOut | None, seed: int) -> ScalarReader:
    """Learn a label (n,) from what is known of frames in time order of presses (n,), from their signals (n, m)
    without the frames that follow, and from the places read of them when they were held out. taken_out: directions of
    drift, of all signals and of those whose untouched frame is old. NothingToRead where held-out presses are read no
    better than by the mean."""
    drift, target, blocks = known.signals.drift, label[:, None], press_blocks(press)
    count = int(press.max()) + 1
    signal, cut = without(drift, known.signal, taken_out[0]), without(drift, lacking, taken_out[0])
    at, at_cut, at_old = (place.place, place.cut, place.old) if place else (None, None, None)
    raw = _context(signal, at)
    context = Context(raw.mean(axis=0), np.maximum(raw.std(axis=0), np.finfo(float).tiny))
    features, near = learn_features(signal), context.of(signal, at)
    ridge, sized = kernel_ridge.fit(signal, target, press), kernel_ridge.fit(near, target, press)
    ensemble, of_networks = networks.fit(_inputs(features, signal, near), target, blocks, seed, EPOCHS)
    each = np.stack([kernel_ridge.held_out(ridge, signal, target, blocks),
                     kernel_ridge.held_out(sized, near, target, blocks), of_networks])
    value, of_each = stacking.combined(each, target, np.ones(len(each)), blocks, press)
    apart = kernel_ridge.nearest_held_out(ridge, blocks)
    unlikeness = learn_unlikeness(apart)
    wider = place.widening if place else unlikeness.widening(apart)
    mean, none = np.broadcast_to(target.mean(axis=0), target.shape), np.zeros_like(target)
    check_worth(value, mean, target, press, name, unit_of(name))
    of_cut = networks.held_out(ensemble, _inputs(features, cut, context.of(cut, at_cut)), blocks)
    places = (at_old, *(place.aged if place else [None] * len(known.aged)))
    spared, *views = (context.of(without(drift, one, taken_out[1]), there)
                      for one, there in zip((known.signal, *(one.signal for one in known.aged)), places, strict=True))
    old = kernel_ridge.fit(spared, target, press) if len(drift.root) else sized
    fresh, *seen = ((kernel_ridge.held_out(old, spared, target, blocks, one) for one in (spared, *views))
                    if len(drift.root) else each[1:2])
    return ScalarReader(name, context, features, ridge, sized, ensemble, old,
                        stacking.weights(each, target, np.ones(len(each)), count), unlikeness,
                        calibrated((value - target) / wider[:, None], _spread(of_each, each, value), none[:, 0], count),
                        calibrated(of_cut - target, none, none[:, 0], count),
                        calibrated_by_age(known.aged, target, (fresh, none), tuple((one, none) for one in seen), press),
                        np.array([distance(one, target) for one in (*each, value, mean)]))


def read(reader: ScalarReader, signal: Array, place: Array | None) -> tuple[Array, Bounds]:
    """The label (n,) of signals (n, m) at places as read, and its bounds."""
    near = reader.context.of(signal, place)
    each = np.stack([reader.ridge.read(signal), reader.sized.read(near),
                     reader.networks.read_each(_inputs(reader.features, signal, near)).mean(axis=0)])
    value = np.tensordot(reader.weights, each, 1)
    spread = _spread(np.tile(reader.weights, (len(value), 1)), each, value)
    return value[:, 0], reader.intervals.bounds(spread, np.zeros(len(value)))


def read_old(reader: ScalarReader, spared: Array, place: Array | None, age: Array) -> tuple[Array, Bounds]:
    """Likewise of signals that drift spares, against untouched frames of these ages (n,)."""
    value = reader.old.read(reader.context.of(spared, place))
    value, bounds = reader.of_old.read(age, value, np.zeros_like(value))
    return value[:, 0], bounds


def _context(signal: Array, place: Array | None) -> Array:
    size = np.log(np.maximum(np.linalg.norm(signal, axis=1, keepdims=True), np.finfo(float).tiny))
    return size if place is None else np.hstack([place, size])


def _inputs(features: Features, signal: Array, known: Array) -> Array:
    return np.hstack([features.of(signal), NEAR * known])


def _spread(weights: Array, each: Array, value: Array) -> Array:
    return np.sqrt(np.einsum("nf,fnk->nk", weights, (each - value) ** 2))
