"""Where the middle of a body lies in the coordinates of labels."""

import numpy as np

from touchcal.arrays import Array


def body_middle(place: Array, radius: float) -> Array:
    """(2,) the origin where all places (n, 2) lie on the body of this radius about it, or there are none; else the
    middle of their range. All in one unit."""
    if not len(place) or np.linalg.norm(place, axis=1).max() <= radius:
        return np.zeros(2)
    return np.asarray((place.min(axis=0) + place.max(axis=0)) / 2)
