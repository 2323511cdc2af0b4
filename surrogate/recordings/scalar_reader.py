"""One label read from signals: the depth, the force or the diameter of a press, or one coordinate of it.

At a known place the depth of a press is mostly the size of its signal, so that what the reader of places says of a
press is an input, next to log |s|. Families are combined by what each did on held-out blocks in time.
"""

from dataclasses import dataclass

import numpy as np

from surrogate.recordings import kernel_ridge, networks, stacking
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.intervals import Intervals, calibrated
from surrogate.recordings.kernel_ridge import KernelRidge
from surrogate.recordings.labels import unit_of
from surrogate.recordings.networks import Networks
from surrogate.recordings.patterns import Features, learn_features
from surrogate.recordings.worth import check_worth
from touchcal.arrays import Array

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
    weights: Array  # (families,) in the order of FAMILIES
    intervals: Intervals
    of_cut: Intervals  # of frames whose late readings are not there, by the networks
    held_out: Array  # (families + 2,) mean held-out error of each family, of all combined and of the mean


def fit(name: str, target: Array, signal: Array, place: Array | None, cut: tuple[Array, Array | None],
        seed: int) -> ScalarReader:
    """Learn a label (n,) from signals (n, m) in time order and the places (n, 2) read of them when they were held out;
    cut: likewise without the frames that follow. NothingToRead where held-out presses are read no better than by the
    mean."""
    wanted, blocks = target[:, None], time_blocks(len(target))
    known = _context(signal, place)
    context = Context(known.mean(axis=0), np.maximum(known.std(axis=0), np.finfo(float).tiny))
    features, known = learn_features(signal), context.of(signal, place)
    ridge, sized = kernel_ridge.fit(signal, wanted), kernel_ridge.fit(known, wanted)
    ensemble, of_networks = networks.fit(_inputs(features, signal, known), wanted, blocks, seed, EPOCHS)
    each = np.stack([kernel_ridge.held_out(ridge, signal, wanted, blocks),
                     kernel_ridge.held_out(sized, known, wanted, blocks), of_networks])
    value, of_each = stacking.combined(each, wanted, blocks)
    mean = np.broadcast_to(wanted.mean(axis=0), wanted.shape)
    check_worth(value, mean, wanted, name, unit_of(name))
    of_cut = networks.held_out(ensemble, _inputs(features, cut[0], context.of(*cut)), blocks)
    return ScalarReader(name, context, features, ridge, sized, ensemble, stacking.weights(each, wanted),
                        calibrated(value - wanted, _spread(of_each, each, value)),
                        calibrated(of_cut - wanted, np.zeros_like(wanted)),
                        np.array([float(np.abs(one - wanted).mean()) for one in (*each, value, mean)]))


def read(reader: ScalarReader, signal: Array, place: Array | None) -> tuple[Array, Array]:
    """The label of signals (n, m) at places as read, and the half width of its 90 % interval, (n,) each."""
    known = reader.context.of(signal, place)
    each = np.stack([reader.ridge.read(signal), reader.sized.read(known),
                     reader.networks.read_each(_inputs(reader.features, signal, known)).mean(axis=0)])
    value = np.tensordot(reader.weights, each, 1)
    spread = _spread(np.tile(reader.weights, (len(value), 1)), each, value)
    return value[:, 0], reader.intervals.half_width(spread)[:, 0]


def _context(signal: Array, place: Array | None) -> Array:
    size = np.log(np.maximum(np.linalg.norm(signal, axis=1, keepdims=True), np.finfo(float).tiny))
    return size if place is None else np.hstack([place, size])


def _inputs(features: Features, signal: Array, known: Array) -> Array:
    return np.hstack([features.of(signal), NEAR * known])


def _spread(weights: Array, each: Array, value: Array) -> Array:
    return np.sqrt(np.einsum("nf,fnk->nk", weights, (each - value) ** 2))
