"""Touches followed by a model of a recording: each frame is read, and the place walks at random between them. Other
labels are those of one frame.

A reading errs by a constant of the place, which its calibrated interval holds, and by noise, whose variance is a sixth
of that of second differences of readings of a touch. The filter takes out noise; the interval stays that of one frame.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.dead_readings import SaidOnce, none, too_many
from surrogate.data.outputs import TOUCH as PARTS
from surrogate.data.outputs import lowest
from surrogate.data.reading_noise import ReadingNoise
from surrogate.data.sensor_ring import Ring
from surrogate.data.untouched_stream import Background
from surrogate.forward_map.inversion.touch_filter import WALK
from surrogate.model.recorded.lost_channels import cost_words
from surrogate.model.recorded.press_model import COORDINATES, PressModel
from surrogate.model.tracking.contact import patterns_of
from surrogate.model.tracking.followed_reading import TOO_WEAK, Read, unread
from surrogate.model.tracking.tracked import TOUCH
from surrogate.recordings.press_reader import PressReading, ScalarReading, read
from surrogate.recordings.presses import Presses
from surrogate.recordings.signals import WEAK
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array, Mask

_SIZES = {"d_mm": (2, 1e-3), "F_N": (3, 1.0)}  # labels that are parts of a touch: which, and their unit in SI


@dataclass(frozen=True, eq=False)
class Place:
    """A place after some frames of a touch."""

    mean: Array  # (2,) mm
    variance: Array  # (2,) of its noise, mm^2
    readings: tuple[Array, ...]  # the latest, at most three, mm
    noise: Array  # (2,) mean variance of the noise of a reading, mm^2
    count: int  # second differences that it was averaged over


def begun(reading: Array) -> Place:
    """The place by a first reading (2,), mm."""
    return Place(reading, np.zeros(2), (reading,), np.zeros(2), 0)


def followed(place: Place, reading: Array, step_s: float) -> Place:
    """The place with one more reading (2,), mm, so many seconds later."""
    readings, noise, count = (*place.readings, reading)[-3:], place.noise, place.count
    if len(readings) == 3:
        count += 1
        noise = noise + ((readings[0] - 2 * readings[1] + readings[2]) ** 2 / 6 - noise) / count
    variance = place.variance + WALK[:2] ** 2 * step_s
    gain = variance / np.maximum(variance + noise, np.finfo(float).tiny)
    return Place(place.mean + gain * (reading - place.mean), (1 - gain) * variance, readings, noise, count)


class FollowedPresses:
    """A model of a recording and the place that it follows."""

    def __init__(self, model: PressModel, say: Callable[[str], object]) -> None:
        reader, place = model.of_places
        self.readings = model.readings
        self.columns = [f"{name}{end}_{unit}" for name, unit in zip(model.names, model.units, strict=True)
                        for end in ("", "_lo90", "_hi90")]
        self.patterns = patterns_of(place.direction.pattern[:, :self.readings])
        self.foreseen = self.patterns[:0]
        self.weakest = reader.signals.weakest
        self.ring: Ring | None = None
        self._reader = reader
        self._place: Place | None = None
        late = reader.signals.late
        self.lost = SaidOnce(lambda dead, columns: cost_words(reader, np.append(dead, dead[late]), columns), say)

    def dead(self, volts: Array) -> Mask:
        """Channels without a number."""
        return none(volts)

    def why_not(self, dead: Mask) -> str:
        """Why these are needed."""
        return too_many(dead)

    def ended(self) -> None:
        """No touch is followed."""
        self._place = None

    def with_noise(self, noise: ReadingNoise) -> None:
        """The noise of a place is that of its readings."""

    def ready(self, background: Background) -> tuple[Array, str]:
        """Readings are taken as they are."""
        return self.compared(background)

    def compared(self, background: Background) -> tuple[Array, str]:
        """Readings are taken as they are."""
        return np.ones(self.readings), ""

    def read(self, volts: Array, background: Background, since_s: float, since: int, step_s: float) -> Read:
        """The place with one more frame; the next frame, which may hold late readings, is not waited for."""
        empty = np.full((1, self.readings), np.nan)
        age = since_s if self._reader.signals.clocked else since
        press = Presses(np.array([""]), np.zeros(1, np.int64), (volts - background.volts)[None], empty,
                        np.array([float(age)]), background.volts[None], np.zeros(1), np.zeros(1))
        signals = self._reader.signals
        if np.linalg.norm(signals.whole(press)) < WEAK * signals.weakest:
            self._place = None
            return unread(TOUCH, TOO_WEAK)
        found = read(self._reader, press)
        place = found.place
        assert place is not None
        self._place = begun(place.value[0]) if self._place is None else followed(self._place, place.value[0], step_s)
        return read_of(found, 0, self._place.mean)


def read_of(found: PressReading, k: int, place_mm: Array) -> Read:
    """What is read of frame k with this place (2,)."""
    place = found.place
    assert place is not None
    width = place.bounds.half_width[k]
    scalars = tuple(replace(one, value=one.value[[k]], half_width=one.half_width[[k]]) for one in found.scalars)
    value, half, covariance = np.full(PARTS, np.nan), np.full(PARTS, np.nan), np.full((PARTS, PARTS), np.nan)
    value[:2], half[:2] = place_mm * 1e-3, width * 1e-3
    for one in scalars:
        if one.name in _SIZES:
            part, unit = _SIZES[one.name]
            value[part], half[part] = one.value[0] * unit, one.half_width[0] * unit
    sd, correlation = half / normal(COVERAGE), place.bounds.correlation[k]
    covariance[np.diag_indices(PARTS)] = sd**2
    covariance[0, 1] = covariance[1, 0] = correlation * sd[0] * sd[1]
    return Read(TOUCH, value, covariance, half, half, found.flag[k], row_of(place_mm, width, scalars),
                int(found.kinds[k]))


def row_of(place: Array, half_width: Array, scalars: tuple[ScalarReading, ...]) -> Array:
    """The values of a row, each with the ends of its interval, as `columns` names them."""
    value = np.array([*place, *(one.value[0] for one in scalars)])
    half = np.array([*half_width, *(one.half_width[0] for one in scalars)])
    sized = [False, False, *(one.name not in COORDINATES for one in scalars)]
    return np.stack([value, lowest(value, half, sized), value + half], axis=1).ravel()
