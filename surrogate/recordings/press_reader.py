"""Every label of a press read from its signal: the place where x and y are labelled, and each other label by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from eitsim.sensors.labels import PLACE, Labels
from surrogate.data.dead_readings import too_many
from surrogate.recordings import scalar_reader, touch_reader
from surrogate.recordings.ageing import learn_known
from surrogate.recordings.baselines import without
from surrogate.recordings.dead_channels import filled_without
from surrogate.recordings.late_readings import late_readings
from surrogate.recordings.physics.expectation import Expectation
from surrogate.recordings.press_frames import counted, press_of_frames
from surrogate.recordings.presses import Presses, cut, whole_rest
from surrogate.recordings.scalar_reader import ScalarReader
from surrogate.recordings.session.motion import Motion
from surrogate.recordings.signals import FEWEST, Signals, flags
from surrogate.recordings.touch_reader import Reading, TouchReader
from surrogate.recordings.worth import NothingToRead
from surrogate.statistics.conformal import chosen, conformal_scale, widened
from touchcal.arrays import Array, Index, Mask
from touchcal.lazy import needed

SPARED = 3  # directions of drift taken out where no place is read and the untouched frame is old
Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class PressReader:
    """A trained reader of labels; one of `place` and `scalars` is there."""

    signals: Signals
    place: TouchReader | None
    scalars: tuple[ScalarReader, ...]
    left_out: tuple[str, ...]  # why a label or an untouched frame is not used, a sentence each
    motion: Motion | None = None  # of the skin since the first session

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the labels that are read."""
        return *(PLACE if self.place else ()), *(one.name for one in self.scalars)

    @property
    def errors(self) -> dict[str, float]:
        """Mean error of held-out presses of each output, "place", mm, or a label."""
        each = (*((("place", self.place),) if self.place else ()), *((one.name, one) for one in self.scalars))
        return {name: float(one.held_out[-2]) for name, one in each}

    def whole(self, presses: Presses) -> PressReading:
        """What is read where filling in dead channels costs nothing."""
        return _whole(self, presses)

    def trained_on(self, presses: Presses) -> Mask:
        """(n,) which presses are training ones: their signals, against the same untouched frames, are nodes of the
        kernel ridge regression."""
        ridge = self.place.ridge if self.place else self.scalars[0].ridge
        return ridge.trained_on(self._seen(presses), self._seen(presses.with_noise))

    def yardstick(self, output: str, presses: Presses) -> Array:
        """(n, k) what kernel ridge regression reads of an output."""
        (ridge,) = (one.ridge for name, one in (("place", self.place), *((one.name, one) for one in self.scalars))
                    if one and name == output)
        value = ridge.read(self._seen(presses))
        return value if self.motion is None or output != "place" else self.motion.of(value)

    def _seen(self, presses: Presses) -> Array:
        """(n, m + late) signals of presses as families take them: directions of drift taken out."""
        return without(self.signals.drift, self.signals.whole(presses), self.place.projected if self.place else 0)


class Reader(Protocol):
    """What reads presses, whatever it was learnt by."""

    @property
    def signals(self) -> Signals: ...
    @property
    def labels(self) -> tuple[str, ...]: ...
    @property
    def left_out(self) -> tuple[str, ...]: ...
    @property
    def errors(self) -> dict[str, float]: ...

    def whole(self, presses: Presses) -> PressReading:
        """What is read where filling in dead channels costs nothing."""
        ...

    def trained_on(self, presses: Presses) -> Mask:
        """(n,) which presses are training ones."""
        ...

    def yardstick(self, output: str, presses: Presses) -> Array:
        """(n, k) what kernel ridge regression reads of an output, "place" or a label."""
        ...


@dataclass(frozen=True, eq=False)
class ScalarReading:
    """One label of some frames, in the unit of its name."""

    name: str
    value: Array  # (n,)
    half_width: Array  # (n,) half width of the 90 % interval


@dataclass(frozen=True, eq=False)
class PressReading:
    """What is read of some frames."""

    place: Reading | None
    scalars: tuple[ScalarReading, ...]
    kinds: NDArray[np.int64]  # (n,) why not to trust a frame, sums of `surrogate.data.flags.Flag`
    flag: tuple[str, ...]  # (n,) the same in words; empty where nothing speaks against it


def fit(presses: Presses, labels: Labels, seed: int = 0, expectation: Expectation | None = None) -> PressReader:
    """Learn the labels of frames of presses, in the same time order; frames with dead channels are filled in. What a
    model of the sensor expects is used where it explains held-out presses better.

    A label that is the same in all presses, or of which held-out presses are read no better than by its mean, is left
    out. ValueError where there are fewer than FEWEST presses or no label differs; NothingToRead where none is read.
    """
    needed("torch", "readers of presses, whose families are trained networks among others,")
    press = press_of_frames(presses, labels)
    count = too_few(press)
    varied, left_out = varied_labels(labels)
    if {*PLACE} <= {*varied}:
        place = np.stack([varied.pop(name) for name in PLACE], axis=1)
        known = learn_known(presses, late_readings(presses.signal, presses.following, place, press), count)
        learnt = tried(partial(touch_reader.learn, presses, place, press, known, seed, expectation), left_out)
    else:
        known, learnt = learn_known(presses, np.zeros(0, np.intp), count), None
    reader, held_out = learnt or (None, None)
    taken_out = (reader.projected, reader.spared) if reader else (0, SPARED)
    gone = known.signals.whole(cut(presses))
    scalars = [tried(partial(scalar_reader.fit, name, value, press, known, gone, taken_out, held_out, seed), left_out)
               for name, value in varied.items()]
    scalars = tuple(one for one in scalars if one)
    if not reader and not scalars:
        raise NothingToRead(" ".join(left_out))
    if lacking := len(presses.rest) - len(whole_rest(presses).rest):
        left_out.append(f"{lacking} of {len(presses.rest)} untouched frames have dead channels: drift is learnt from "
                        "the others.")
    return PressReader(known.signals, reader, scalars, tuple(left_out))


def too_few(press: Index) -> int:
    """Number of presses of frames (n,); ValueError where they are fewer than FEWEST."""
    count = int(press.max()) + 1
    if count < FEWEST:
        raise ValueError(f"{counted(count, len(press))} are too few to learn from; give {FEWEST} or more.")
    return count


def varied_labels(labels: Labels) -> tuple[dict[str, Array], list[str]]:
    """The labels that differ from press to press, (n,) each, and why the others are left out; ValueError where none
    does."""
    values = dict(zip(labels.names, labels.values.T, strict=True))
    varied = {name: value for name, value in values.items() if np.ptp(value)}
    left_out = [f"all labelled presses have one {name}, {value[0]:.6g}: press with several, or leave the column out."
                for name, value in values.items() if name not in varied]
    if not varied:
        raise ValueError(" ".join(left_out))
    return varied, left_out


def read(reader: Reader, presses: Presses) -> PressReading:
    """Labels of presses with their intervals and flags.

    Where the frame that follows should hold readings of a press and is not there, intervals are those of the networks
    on presses that lack it. Where the untouched frame is far older than in training, what drift spares is read.
    Where channels are dead, intervals are the wider ones of two: those of a pattern that is unlike the taught ones, as
    filled in, and those of a usual pattern with what filling in moves 90 % of the training presses by, squares added;
    no frame is flagged for it. Where more than MOST_DEAD of them are, values are NaN.
    """
    found = reader.whole(presses)
    added = np.array([without_channels(reader, one.tobytes()).most for one in reader.signals.dead(presses)])
    unread, place = np.isnan(added[:, 0]), found.place
    unlike = np.maximum(place.widening, 1.0) if place else np.ones(len(unread))
    if place:
        half_width = _lacking(place.bounds.half_width, unlike[:, None], added[:, :2])
        place = replace(place, value=np.where(unread[:, None], np.nan, place.value),
                        bounds=replace(place.bounds, half_width=half_width))
    scalars = tuple(replace(one, value=np.where(unread, np.nan, one.value),
                            half_width=_lacking(one.half_width, unlike, extra))
                    for one, extra in zip(found.scalars, added[:, 2:].T, strict=True))
    return PressReading(place, scalars, found.kinds, found.flag)


def _lacking(half_width: Array, unlike: Array, moved: Array) -> Array:
    """Half widths of frames that lack channels, from those of the frames as filled in, the part of these that comes of
    unlike patterns, and what filling in moves training presses by."""
    return np.maximum(half_width, np.hypot(half_width / unlike, moved))


@dataclass(frozen=True, eq=False)
class Moved:
    """How far filling in dead channels moves training presses in x, y and each label; NaN where too many are dead."""

    most: Array  # (2 + labels,) 90 % of them
    mean: Array  # (1 + labels,) mean distance of the place, mm, and mean of each label


@lru_cache(maxsize=32)
def without_channels(reader: Reader, dead: bytes) -> Moved:
    """What filling in dead readings, bytes of a mask (m + late,), does to the training presses, each filled in by what
    the others say."""
    signals, mask = reader.signals, np.frombuffer(dead, bool)
    if not mask.any() or too_many(mask[:signals.channels]):
        labels = len(reader.labels) - 2 * ({*PLACE} <= {*reader.labels})
        none = np.full(2 + labels, np.nan if mask.any() else 0.0)
        return Moved(none, none[1:])
    lacking = filled_without(signals.readings, mask)
    seen = [reader.whole(signals.presses(one)) for one in (signals.readings.kept, lacking)]
    each = [np.column_stack([one.place.value if one.place else np.zeros((len(lacking), 2)),
                             *(label.value for label in one.scalars)]) for one in seen]
    moved = each[1] - each[0]
    return Moved(conformal_scale(moved, np.ones_like(moved), len(lacking)),
                 np.array([np.linalg.norm(moved[:, :2], axis=1).mean(), *np.abs(moved[:, 2:]).mean(axis=0)]))


def _whole(reader: PressReader, presses: Presses) -> PressReading:
    """What is read where filling in dead channels costs nothing."""
    place = touch_reader.read(reader.place, presses) if reader.place else None
    where, signals = place.value if place else None, reader.signals
    signal = reader._seen(presses)
    spared = without(signals.drift, signals.whole(presses), reader.place.spared if reader.place else SPARED)
    scalars, strange = [], place.strange if place else np.zeros(len(signal), bool)
    for one in reader.scalars:
        value, bounds = scalar_reader.read(one, signal, where)
        distance = one.ridge.nearest(signal)
        if not place:
            strange |= one.unlikeness.odd(distance)
        none = np.zeros((len(signal), 1))
        bounds = chosen(signals.cut(presses), one.of_cut.bounds(none, none[:, 0]), bounds)
        bounds = widened(bounds, place.widening if place else one.unlikeness.of_session(
            distance, distance[~signals.spared(presses)]))
        old, of_old = scalar_reader.read_old(one, spared, where, presses.age)
        bounds = chosen(signals.spared(presses), of_old, bounds)
        value = np.where(signals.spared(presses), old, value) + (0.0 if one.shift is None else one.shift)
        scalars.append(ScalarReading(one.name, value, bounds.half_width[:, 0]))
    if place and reader.motion:
        place = replace(place, value=reader.motion.of(place.value),
                        bounds=reader.motion.bounds(place.value, place.bounds))
    return PressReading(place, tuple(scalars), *flags(reader.signals, presses, strange))


def tried(learn: Callable[[], Found], left_out: list[str]) -> Found | None:
    """What is learnt; None where there is nothing to read, and why is added."""
    try:
        return learn()
    except NothingToRead as refusal:
        left_out.append(str(refusal))
        return None
