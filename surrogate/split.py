"""Training, validation and test rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PARTS = ("train", "val", "test")
FRACTIONS = (0.70, 0.15)
# Fewest rows that give each part a few.
MIN_ROWS = 20


def split(count: int, seed: int) -> NDArray[np.str_]:
    """(count,) the part of each row: 70 % train, 15 % val, the rest test, drawn by the seed.

    ValueError for fewer than MIN_ROWS rows.
    """
    if count < MIN_ROWS:
        raise ValueError(f"{count} ok rows are too few to train, validate and test on; at least {MIN_ROWS} are needed. "
                         "Sweep more scenes.")
    train, val = (round(fraction * count) for fraction in FRACTIONS)
    labels = np.repeat(PARTS, [train, val, count - train - val])
    return np.random.default_rng(seed).permutation(labels)
