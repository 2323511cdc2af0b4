"""Which readings are none, and how many of these a frame may have and still be read."""

import numpy as np

from touchcal.arrays import Array, Mask

MOST = 1e12  # no instrument reads more, in volts or in counts
MOST_DEAD = 0.5  # most readings, as a part of all, that a model can do without


def none(readings: Array) -> Mask:
    """Which readings are no number, or none that an instrument reads."""
    return ~(np.abs(readings) <= MOST)


def too_many(dead: Mask) -> str:
    """In words, that too many readings (m,) of a frame are dead; empty where they are not."""
    return (f"{dead.sum()} of {len(dead)} readings are dead, and half or more are needed"
            if np.mean(dead) > MOST_DEAD else "")
