"""Training, validation and test rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

PARTS = ("train", "val", "test")
FRACTIONS = (0.70, 0.15)
# Fewest touches that give each part a few.
MIN_TOUCHES = 20


def split(touch: ArrayLike, seed: int) -> NDArray[np.str_]:
    """(n,) the part of each row: 70 % of the touches train, 15 % val, the rest test, drawn by the seed.

    touch: (n,) number that rows share which are not to be parted, as one touch with several cards. ValueError for fewer
    than MIN_TOUCHES different ones.
    """
    _, first, place = np.unique(touch, return_index=True, return_inverse=True)
    count = len(first)
    if count < MIN_TOUCHES:
        rows = f"{len(place)} ok rows" + (f" of {count} different touches" if count < len(place) else "")
        raise ValueError(f"{rows} are too few to train, validate and test on; at least {MIN_TOUCHES} are needed. Sweep "
                         "more scenes.")
    train, val = (round(fraction * count) for fraction in FRACTIONS)
    labels = np.repeat(PARTS, [train, val, count - train - val])
    drawn = np.random.default_rng(seed).permutation(labels)
    return drawn[np.argsort(np.argsort(first))][place]
