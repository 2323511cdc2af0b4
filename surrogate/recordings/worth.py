"""Whether a reader says more than the mean of what it was trained on."""

import numpy as np

from touchcal.arrays import Array, Index

# Standard errors by which the mean of held-out errors must lie below that from the mean; chance alone reaches it once
# in 20 times. Of fewer than ENOUGH presses, which show little surely, so many times less: the scores say the rest.
SURE, ENOUGH = 1.65, 50


class NothingToRead(ValueError):
    """The signals say no more of a label than its mean does."""


def distance(value: Array, target: Array) -> float:
    """Mean distance of values (n, k) from targets (n, k) or (k,)."""
    return float(np.linalg.norm(value - target, axis=-1).mean())


def check_worth(value: Array, mean: Array, target: Array, press: Index, name: str, unit: str) -> None:
    """NothingToRead where held-out values (n, k) of targets (n, k), of presses (n,), are no better than their mean."""
    of_frames = np.linalg.norm(mean - target, axis=1) - np.linalg.norm(value - target, axis=1)
    gain = np.bincount(press, of_frames) / np.bincount(press)
    if gain.mean() <= SURE * min(len(gain) / ENOUGH, 1.0) * gain.std() / np.sqrt(len(gain)):
        raise NothingToRead(f"nothing to read here of {name}: held-out presses are read to "
                            f"{distance(value, target):.3g} {unit}, not surely nearer than by their mean, "
                            f"{distance(mean, target):.3g} {unit}. Check that the labels belong to this recording, and "
                            "that touches change the readings by more than noise.")
