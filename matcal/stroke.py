"""The parts of a crosshead's record: rest, loading, and what comes after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.thinning import sample_noise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stroke:
    """Where the first loading of a record lies."""

    # (n,) travel from rest, m, positive in the direction of loading
    travel: Array
    # 1.0 where the file's displacement grows under load, -1.0 where it falls
    sign: float
    # index of the first sample that moves
    start: int
    # index of the first sample at the end of the loading
    end: int
    # number of loadings in the record
    loadings: int
    # noise of the displacement, m
    noise_m: float


def find_stroke(displacement: Array) -> Stroke:
    """The first loading of a displacement record (n,), m; ValueError where nothing moves.

    A loading ends where the travel first comes within its noise of the local extreme; a later fall below half of the
    largest travel and a new rise is a further loading.
    """
    noise = sample_noise(displacement)
    away = displacement - np.median(displacement[:_at_rest(displacement)])
    sign = 1.0 if away[np.argmax(np.abs(away))] > 0 else -1.0
    travel = sign * away
    largest = float(travel.max())
    margin = max(5 * noise, 1e-3 * largest)
    if largest <= 0 or np.count_nonzero(travel > margin) < 5:
        raise ValueError("the displacement never leaves its rest position")
    high = int(np.argmax(travel >= 0.95 * largest))
    low_again = np.flatnonzero(travel[high:] < 0.9 * largest)
    until = high + (int(low_again[0]) if low_again.size else travel.size - high)
    top = float(travel[high:until].max())
    end = high + int(np.argmax(travel[high:until] >= top - margin / 2))
    start = int(np.flatnonzero(travel[:high] <= margin)[-1]) + 1 if np.any(travel[:high] <= margin) else 0
    return Stroke(travel, sign, start, end, _loadings(travel, largest), noise)


def _at_rest(displacement: Array) -> int:
    """How many of the first samples stay together: the rest that the travel is measured from."""
    reach = 1e-3 * np.ptp(displacement)
    moved = np.flatnonzero(np.abs(displacement - displacement[0]) > max(reach, 6 * sample_noise(displacement)))
    return max(1, int(0.9 * moved[0])) if moved.size else displacement.size


def _loadings(travel: Array, largest: float) -> int:
    state, count = False, 0
    for value in travel:
        if not state and value > 0.75 * largest:
            state, count = True, count + 1
        elif state and value < 0.25 * largest:
            state = False
    return count
