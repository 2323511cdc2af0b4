"""Places read from signals by several families, combined by what each did on held-out blocks in time."""

from dataclasses import dataclass

import numpy as np

from surrogate.recordings import kernel_ridge, networks, stacking, templates
from surrogate.recordings.baselines import Drift, learn_drift, without
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.dead_channels import Readings, filled, learn_readings
from surrogate.recordings.intervals import Intervals, calibrated
from surrogate.recordings.kernel_ridge import KernelRidge
from surrogate.recordings.late_readings import late_readings, with_late
from surrogate.recordings.networks import Networks
from surrogate.recordings.patterns import Features, learn_features
from surrogate.recordings.presses import Presses
from surrogate.recordings.templates import Templates
from surrogate.recordings.waves import Waves, draw_waves
from touchcal.arrays import Array, Index, Mask

FAMILIES = ("kernel ridge", "templates of direction", "templates of readings", "networks", "networks on templates",
            "corrected templates")
FEWEST = 10  # presses to learn from
# Directions of drift that may be projected out of all signals, and those that are where the untouched frame is old.
PROJECTED, PROJECTED_OLD = (0, 3, 6), 6
OLD = 2.0  # times the greatest age of an untouched frame in training: one that is older is read by what drift spares
STRANGE = 1.5  # times the greatest misfit of held-out presses: a signal further from all templates is flagged
WEAK = 0.3  # of the weakest training signal
# Standard errors by which the mean square of held-out distances must lie below that from the mean place; chance alone
# reaches it once in 20 times.
SURE = 1.65


class NothingToRead(ValueError):
    """The signals say no more of the places than their mean does."""


@dataclass(frozen=True, eq=False)
class TouchReader:
    """A trained reader of places."""

    late: Index  # readings that the frame which follows holds
    readings: Readings  # of the signals with the late readings appended
    drift: Drift  # likewise
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
    greatest_age: float  # of an untouched frame in training
    greatest_misfit: float  # of a held-out press from the templates of direction
    weakest: float  # norm of the weakest training signal
    held_out: Array  # (families + 2,) mean held-out distance of each family, of all combined and of the mean, mm


@dataclass(frozen=True, eq=False)
class Reading:
    """Places of some frames."""

    value: Array  # (n, 2) mm
    half_width: Array  # (n, 2) half width of the 90 % interval, mm
    flag: tuple[str, ...]  # (n,) why not to trust a frame; empty where nothing speaks against it


def fit(presses: Presses, place: Array, seed: int = 0) -> TouchReader:
    """Learn places (n, 2), mm, from presses in time order; frames with dead channels are filled in.

    ValueError where there are fewer than FEWEST presses or all lie at one place; NothingToRead where held-out presses
    are read no better than by the mean place.
    """
    if len(place) < FEWEST:
        raise ValueError(f"{len(place)} labelled presses are too few to learn from; give {FEWEST} or more.")
    if not np.ptp(place, axis=0).all():
        raise ValueError("all labelled presses have one x or one y; press places that spread over the skin.")
    blocks = time_blocks(len(place))
    late = late_readings(presses.signal, presses.following, place)
    readings, signal = _whole(with_late(presses.signal, presses.following, late))
    drift = learn_drift(np.hstack([presses.rest, presses.rest[:, late]]), presses.rest_time)
    projected, direction = min(
        ((count, templates.fit(without(drift, signal, count), place, blocks, compress=False)) for count in PROJECTED
         if count <= len(drift.root) // 2 or not count),
        key=lambda one: _distance(one[1].place, place))
    kept = without(drift, signal, projected)
    ridge = kernel_ridge.fit(kept, place)
    compressed = templates.fit(kept, place, blocks, compress=True)
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
    _check_worth(value, mean, place)
    old = (templates.fit(without(drift, signal, PROJECTED_OLD), place, blocks, compress=False) if len(drift.root)
           else direction)
    cut = filled(readings, with_late(presses.signal, np.full_like(presses.following, np.nan), late))
    of_cut = networks.held_out(ensemble, features.of(without(drift, cut, projected)), blocks)
    return TouchReader(late, readings, drift, projected, ridge, direction.templates, compressed.templates, features,
                       waves, ensemble, on_templates, correction, old.templates, weights,
                       calibrated(value - place, spread), calibrated(of_cut - place, np.zeros_like(place)),
                       float(presses.age.max()), float(direction.misfit.max()),
                       float(np.linalg.norm(kept, axis=1).min()),
                       np.array([_distance(one, place) for one in (*each, value, mean)]))


def read(reader: TouchReader, presses: Presses) -> Reading:
    """Places of presses with their intervals and flags.

    Where the frame that follows should hold readings of a press and is not there, intervals are those of the networks
    on presses that lack it. Where the untouched frame is far older than in training, templates of the signal without
    the main directions of drift read the place; intervals then do not hold, which the flag says.
    """
    dead = np.isnan(presses.signal).sum(axis=1)
    cut = np.isnan(presses.following[:, reader.late]).sum(axis=1) > 0
    signal = filled(reader.readings, with_late(presses.signal, presses.following, reader.late))
    kept = without(reader.drift, signal, reader.projected)
    direction, compressed = reader.direction.read(kept), reader.compressed.read(kept)
    inputs = reader.features.of(kept)
    further = np.hstack([inputs, reader.waves.of(direction[0]), reader.waves.of(compressed[0])])
    each = np.stack([reader.ridge.read(kept), direction[0], compressed[0],
                     reader.networks.read_each(inputs).mean(axis=0),
                     reader.on_templates.read_each(further).mean(axis=0),
                     compressed[0] + reader.correction.read_each(further).mean(axis=0)])
    value = np.tensordot(reader.weights, each, 1)
    spread = _spread(np.tile(reader.weights, (len(value), 1)), each, value, direction[1], compressed[1])
    old = (presses.age > OLD * reader.greatest_age) & (len(reader.drift.root) > 0)
    if old.any():
        value[old], spread[old], _ = reader.old.read(without(reader.drift, signal[old], PROJECTED_OLD))
    strange = direction[2] > STRANGE * reader.greatest_misfit
    weak = np.linalg.norm(kept, axis=1) < WEAK * reader.weakest
    half_width = reader.intervals.half_width(spread)
    half_width[cut & ~old] = reader.of_cut.half_width(np.zeros((1, 2)))
    return Reading(value, half_width, _flags(dead, cut, old, strange, weak))


def prepared(reader: TouchReader, presses: Presses) -> Array:
    """Signals (n, m + late) as the families take them: late readings appended, dead channels filled in, directions of
    drift taken out."""
    signal = with_late(presses.signal, presses.following, reader.late)
    return without(reader.drift, filled(reader.readings, signal), reader.projected)


def _flags(dead: Array, cut: Mask, old: Mask, strange: Mask, weak: Mask) -> tuple[str, ...]:
    words = [(cut, "the frame that follows, which holds some readings of this one, is not there"),
             (old, "the untouched frame is older than any in training, so the intervals may not hold"),
             (strange, "a pattern unlike those of the training presses"),
             (weak, "weaker than any training press")]
    return tuple("; ".join([f"{count} dead channels filled in"] * bool(count)
                           + [text for mask, text in words if mask[row]])
                 for row, count in enumerate(dead.tolist()))


def _whole(signal: Array) -> tuple[Readings, Array]:
    """The distribution of signals without dead channels, and all signals with those filled in."""
    whole = ~np.isnan(signal).any(axis=1)
    if whole.sum() < FEWEST:
        dead = np.flatnonzero(np.isnan(signal).any(axis=0))
        raise ValueError(f"readings {', '.join(f'v_{number:03d}' for number in dead[:5])} are dead in most labelled "
                         f"presses; {FEWEST} or more must be whole. Leave these columns out of recording and sensor.")
    readings = learn_readings(signal[whole])
    return readings, filled(readings, signal)


def _spread(weights: Array, each: Array, value: Array, direction_sd: Array, compressed_sd: Array) -> Array:
    """(n, 2) how far places (families, n, 2) of weights (n, families) lie from their mean (n, 2), with what the
    templates leave open."""
    variance = np.einsum("nf,fnk->nk", weights, (each - value) ** 2)
    return np.sqrt(variance + weights[:, [1]] * direction_sd**2 + weights[:, [2]] * compressed_sd**2)


def _check_worth(value: Array, mean: Array, place: Array) -> None:
    gain = np.sum((mean - place) ** 2 - (value - place) ** 2, axis=1)
    if gain.mean() <= SURE * gain.std() / np.sqrt(len(gain)):
        raise NothingToRead(f"nothing to read here: held-out presses are read to {_distance(value, place):.3g} mm, and "
                            f"the mean place is as near, {_distance(mean, place):.3g} mm. Check that the labels belong "
                            "to this recording, and that touches change the readings by more than their noise.")


def _distance(value: Array, place: Array) -> float:
    return float(np.linalg.norm(value - place, axis=1).mean())
