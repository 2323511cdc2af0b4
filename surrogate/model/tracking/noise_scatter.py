"""What untouched frames of a stream show of the noise that readings share, by what each differs from the one before."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.reading_noise import ReadingNoise, by_scatter
from surrogate.data.sensor_ring import Ring
from touchcal.arrays import Array

# Differences that noise is first learnt from, by how many times as many each time again, and those that are kept.
FIRST, AGAIN, KEPT = 16, 2, 400
ODD = 25.0  # squares of a difference over the median one from which it is a jump
_CLEARLY = 10.0  # square of a change over what noise makes of it from which frames moved


@dataclass(frozen=True, eq=False)
class Scatter:
    """Differences of untouched frames, over the root of 2."""

    off: Sequence[Array]  # the latest, (readings,) each
    last: Array | None  # the frame before, where no touch came after it
    due: int  # differences from which noise is learnt the next time
    seen: int  # differences so far


def begun() -> Scatter:
    """Before any frame."""
    return Scatter((), None, FIRST, 0)


def interrupted(scatter: Scatter) -> Scatter:
    """With a touch after the latest frame."""
    return replace(scatter, last=None)


def scaled(scatter: Scatter, gain: Array) -> Scatter:
    """With all readings multiplied by factors (readings,)."""
    return replace(scatter, off=tuple(one * gain for one in scatter.off),
                   last=None if scatter.last is None else scatter.last * gain)


def with_frame(scatter: Scatter, volts: Array) -> tuple[Scatter, bool]:
    """With one more untouched frame (readings,), and whether noise is to be learnt again."""
    if scatter.last is None:
        return replace(scatter, last=volts), False
    off, seen = [*scatter.off, (volts - scatter.last) / np.sqrt(2)][-KEPT:], scatter.seen + 1
    due = seen >= scatter.due
    later = min(AGAIN * scatter.due, scatter.due + KEPT) if due else scatter.due
    return Scatter(off, volts, later, seen), due


def noise(scatter: Scatter, untouched_V: Array, ring: Ring | None) -> ReadingNoise | None:
    """The noise of a frame by the differences that are no jumps; None where they are too few or none differs."""
    off = np.array(scatter.off)
    there = np.all(np.isfinite(off), axis=0) & np.any(off != 0, axis=0)
    if not there.any():
        return None
    square = np.mean(off[:, there] ** 2, axis=1)
    off = off[square < ODD * np.median(square)]
    return by_scatter(off, float(len(off)), np.nan_to_num(untouched_V), ring, there) if len(off) >= FIRST // 2 else None


def moved(scatter: Scatter) -> float:
    """The largest norm, V, by which a frame differs from the first of those kept, by more than the noise that third
    differences show, which what moves evenly leaves out; 0 where none does."""
    off = np.nan_to_num(np.array(scatter.off))
    if len(off) < FIRST // 2:
        return 0.0
    most = 2 * float(np.sum(np.cumsum(off, axis=0) ** 2, axis=1).max())
    noise = 2 / 20 * float(np.mean(np.sum(np.diff(off, 2, axis=0) ** 2, axis=1)))
    return most**0.5 if most > _CLEARLY * 2 * noise else 0.0
