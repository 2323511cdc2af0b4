"""Recorded presses read by any learner of the registry: signals in, labels out, with intervals of held-out blocks."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from eitsim.sensors.labels import PLACE, Labels, unit_of
from surrogate.data.samples import Samples, take
from surrogate.learners.base import Learner, Training
from surrogate.learners.registry import method_of
from surrogate.recordings import kernel_ridge
from surrogate.recordings.ageing import learn_known
from surrogate.recordings.blocks import press_blocks
from surrogate.recordings.kernel_ridge import KernelRidge
from surrogate.recordings.press_frames import press_of_frames
from surrogate.recordings.press_reader import PressReading, ScalarReading, too_few, tried, varied_labels
from surrogate.recordings.presses import Presses
from surrogate.recordings.signals import Signals, flags
from surrogate.recordings.touch_reader import Reading
from surrogate.recordings.worth import NothingToRead, check_worth, distance
from surrogate.statistics.conformal import Intervals, calibrated, widened
from surrogate.statistics.unlikeness import Unlikeness, learn_unlikeness
from touchcal.arrays import Array, Index, Mask


@dataclass(frozen=True, kw_only=True)
class PressSamples(Samples):
    """Labelled frames of recorded presses, dead channels filled in; a group is a press."""

    ages: Array  # (n,) of the untouched frame, in the unit of `Presses.age`

    @property
    def age(self) -> Array:
        """(n,) age of the untouched frame."""
        return self.ages


@dataclass(frozen=True, eq=False)
class Output:
    """What is known of one output: of the place, or of another label."""

    name: str  # "place" or the label's
    ridge: KernelRidge  # the yardstick
    intervals: Intervals
    held_out: Array  # (2,) mean held-out error, and that of the mean


@dataclass(frozen=True, eq=False)
class PlainReader:
    """A learner of signals and what recorded presses need next to it."""

    signals: Signals
    columns: tuple[str, ...]  # labels that the learner was taught, in its order
    outputs: tuple[Output, ...]
    unlikeness: Unlikeness  # by the squared distance from the nearest training signal
    left_out: tuple[str, ...]
    learner: Learner

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the labels that are read."""
        return tuple(label for one in self.outputs for label in (PLACE if one.name == "place" else (one.name,)))

    @property
    def errors(self) -> dict[str, float]:
        """Mean error of held-out presses of each output."""
        return {one.name: float(one.held_out[0]) for one in self.outputs}

    def whole(self, presses: Presses) -> PressReading:
        """What is read where filling in dead channels costs nothing."""
        signal = self.signals.whole(presses)
        found, distance = self.learner.estimate(signal, 0.0), self.outputs[0].ridge.nearest(signal)
        strange = self.unlikeness.odd(distance)
        wider = self.unlikeness.of_session(distance, distance[~self.signals.spared(presses)])
        place, scalars = None, []
        for one in self.outputs:
            value, spread = _of((found.value, found.sd), self.columns, one.name)
            bounds = widened(one.intervals.bounds(spread, np.zeros(len(spread))), wider)
            if one.name == "place":
                place = Reading(value, bounds, strange, wider)
            else:
                scalars.append(ScalarReading(one.name, value[:, 0], bounds.half_width[:, 0]))
        return PressReading(place, tuple(scalars), *flags(self.signals, presses, strange))

    def trained_on(self, presses: Presses) -> Mask:
        """(n,) which presses are training ones."""
        return self.outputs[0].ridge.trained_on(self.signals.whole(presses), self.signals.whole(presses.with_noise))

    def yardstick(self, output: str, presses: Presses) -> Array:
        """(n, k) what kernel ridge regression reads of an output."""
        (ridge,) = (one.ridge for one in self.outputs if one.name == output)
        return ridge.read(self.signals.whole(presses))

    def choice(self) -> tuple[str, ...]:
        """In words, how each output did on held-out blocks in time."""
        return (*(f"{one.name}: mean error on held-out blocks in time {one.held_out[0]:.3g} {_unit(one.name)}, of the "
                  f"mean {one.held_out[1]:.3g}" for one in self.outputs), *self.left_out)


def fit(method: str, presses: Presses, labels: Labels, seed: int = 0) -> PlainReader:
    """Teach a learner the labels of frames of presses, in the same time order; intervals by learners that are each
    taught without a block in time. A label that is the same in all presses, or of which held-out
    presses are read no better than by its mean, is left out. ValueError where there are too
    few presses or no label differs, or where the learner refuses them; NothingToRead where none is read."""
    press = press_of_frames(presses, labels)
    too_few(press)
    varied, left_out = varied_labels(labels)
    known = learn_known(presses, np.zeros(0, np.intp), int(press.max()) + 1)
    rows = PressSamples(signal_V=known.signal, target=np.column_stack([*varied.values()]), names=tuple(varied),
                        group=press.astype(np.int64), ages=presses.age)
    chosen = method_of(method)
    training = Training(rows.names, seed, chosen.epochs)
    held = _held_out(chosen.learner(), rows, training)
    both = {*PLACE} <= {*rows.names}
    names = (*(["place"] if both else []), *(name for name in rows.names if not (both and name in PLACE)))
    outputs = tuple(one for name in names if (one := tried(partial(_output, name, rows, held, press), left_out)))
    if not outputs:
        raise NothingToRead(" ".join(left_out))
    distance = kernel_ridge.nearest_held_out(outputs[0].ridge, press_blocks(press))
    return PlainReader(known.signals, rows.names, outputs, learn_unlikeness(distance), tuple(left_out),
                       chosen.learner().fit(rows, training))


def _held_out(learner: type[Learner], rows: PressSamples, training: Training) -> tuple[Array, Array]:
    """Values and standard deviations (n, outputs) of all rows, by learners taught without their block in time."""
    blocks = press_blocks(rows.group.astype(np.intp))
    value, sd = np.empty_like(rows.target), np.empty_like(rows.target)
    for block in np.unique(blocks):
        gone = blocks == block
        found = learner.fit(take(rows, ~gone), training).estimate(rows.signal_V[gone], 0.0)
        value[gone], sd[gone] = found.value, found.sd
    return value, sd


def _output(name: str, rows: PressSamples, held: tuple[Array, Array], press: Index) -> Output:
    target = rows.targets(PLACE if name == "place" else (name,))
    value, spread = _of(held, rows.names, name)
    mean = np.broadcast_to(target.mean(axis=0), target.shape)
    check_worth(value, mean, target, press, name, _unit(name))
    return Output(name, kernel_ridge.fit(rows.signal_V, target, press),
                  calibrated(value - target, spread, np.zeros(len(value)), int(press.max()) + 1),
                  np.array([distance(value, target), distance(mean, target)]))


def _of(found: tuple[Array, Array], columns: tuple[str, ...], name: str) -> tuple[Array, Array]:
    """(n, k) values and standard deviations of an output."""
    rows = [columns.index(one) for one in (PLACE if name == "place" else (name,))]
    value, sd = found
    return value[:, rows], sd[:, rows]


def _unit(name: str) -> str:
    return "mm" if name == "place" else unit_of(name)
