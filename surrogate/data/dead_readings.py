"""How many dead readings a frame may have and still be read."""

import numpy as np

from touchcal.arrays import Mask

MOST_DEAD = 0.5  # most readings, as a part of all, that a model can do without


def too_many(dead: Mask) -> str:
    """In words, that too many readings (m,) of a frame are dead; empty where they are not."""
    return (f"{dead.sum()} of {len(dead)} readings are dead, and half or more are needed"
            if np.mean(dead) > MOST_DEAD else "")
