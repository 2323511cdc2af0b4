"""What following a touch by one more frame gives, whatever the model."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from surrogate.data.dead_readings import SaidOnce
from surrogate.data.outputs import TOUCH
from surrogate.data.reading_noise import ReadingNoise
from surrogate.data.sensor_ring import Ring
from surrogate.data.untouched_stream import Background
from touchcal.arrays import Array, Mask

TOO_WEAK = "weaker than any trained touch"


@dataclass(frozen=True, eq=False)
class Read:
    """A touch as it is now; fields as those of `Tracked`."""

    state: str
    value: Array
    covariance: Array
    below: Array
    above: Array
    flag: str
    row: Array | None = None
    kinds: int = 0


def unread(state: str, flag: str, kinds: int = 0) -> Read:
    """No touch that can be read."""
    none = np.full(TOUCH, np.nan)
    return Read(state, none, np.full((TOUCH, TOUCH), np.nan), none, none, flag, None, kinds)


class Following(Protocol):
    """A model that follows touches, one at a time."""

    readings: int
    patterns: Array  # (k, readings) unit patterns of touches
    foreseen: Array  # (k, readings) changes of the untouched frame by causes that may drift, none where none is known
    weakest: float  # norm of the weakest training signal, in the unit of the readings
    columns: list[str]  # names of the values of a row, with the ends of their 90 % intervals
    ring: Ring | None  # whose readings these are, where that is known
    lost: SaidOnce  # what channels that frames are read without cost

    def dead(self, volts: Array) -> Mask:
        """(readings,) channels of a frame that read nothing."""
        ...

    def ready(self, background: Background) -> tuple[Array, str]:
        """What `compared` says, once the noise is known."""
        ...

    def compared(self, background: Background) -> tuple[Array, str]:
        """Factors (readings,) of all readings that make the untouched frame the training's, and words on it."""
        ...

    def with_noise(self, noise: ReadingNoise) -> None:
        """Count what readings of a frame share of its noise from now on, at the size of the background's."""
        ...

    def why_not(self, dead: Mask) -> str:
        """In words, why no touch can be read without these channels; empty where one can."""
        ...

    def read(self, volts: Array, background: Background, since_s: float, since: int, step_s: float) -> Read:
        """The touch with one more frame (readings,), NaN where a channel is dead, so many seconds and frames after the
        latest untouched frame, and so many seconds after the latest frame."""
        ...

    def ended(self) -> None:
        """Nothing touches any more."""
        ...
