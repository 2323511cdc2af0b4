"""How untouched frames scatter: noise that no frame shares with the next, changes that last over frames, and what both
leave in a touched less an untouched frame.

A few frames that are touched though not marked so do not count: those whose mean square, or that of a difference of
frames, is many times the median. A step between neighbouring values of a reading
hides what is less: noise is a twelfth of its square at least.
"""

import math

import numpy as np

from eitsim.sensors.reading_checks import mean_frame
from eitsim.sensors.recording import Recording, in_phase
from touchcal.arrays import Array, Mask

_ENDS = 0.1  # part of the untouched frames at either end that drift is taken between
_FEWEST = 3  # untouched frames that noise is taken from
_ODD = 8.0  # mean squares that are more than so many times the median are of touches
_MOSTLY = 0.5  # of sorted values, the part below which those that differ from their neighbour show a step


def noise(untouched: Array) -> float | None:
    """Standard deviation of one reading that no frame shares with the next, over the frames' r.m.s., by the third
    differences of successive untouched frames (frames, readings), which leave out ramps and slow waves; empty frames do
    not count; None of fewer than three.

    Of noise that lasts, or of a random walk, this is the part that the shortest changes have: about the floor of its
    spectrum.
    """
    untouched = _not_empty(untouched)
    if len(untouched) < _FEWEST:
        return None
    order = min(3, len(untouched) - 1)
    square = _typical(np.diff(untouched, order, axis=0)) / math.comb(2 * order, order)
    return float(np.sqrt(max(square, step(untouched) ** 2 / 12) / np.nanmean(untouched**2)))


def lasting(untouched: Array) -> float | None:
    """Standard deviation of one reading about the median untouched frame, over the frames' r.m.s., less `noise`, in
    squares: what lasts over frames, of noise, a walk, a wave or a ramp; None of fewer than three."""
    untouched, least = _not_empty(untouched), noise(untouched)
    if least is None:
        return None
    middle = np.nanmedian(untouched, axis=0)
    square = _typical(untouched - middle) * len(untouched) / (len(untouched) - 1) / np.nanmean(untouched**2)
    return float(np.sqrt(max(square - least**2, 0.0)))


def drift(untouched: Array) -> float | None:
    """Change from the first tenth of untouched frames (frames, readings) to the last over the first, 2-norms; empty
    frames do not count; None of fewer than three."""
    untouched = _not_empty(untouched)
    if len(untouched) < _FEWEST:
        return None
    part = max(1, int(_ENDS * len(untouched)))
    first, last = mean_frame(untouched[:part]), mean_frame(untouched[-part:])
    kept = np.isfinite(first) & np.isfinite(last)
    return float(np.linalg.norm((last - first)[kept]) / np.linalg.norm(first[kept]))


def change_noise(recording: Recording, there: Mask, matrix: Array | None = None) -> float | None:
    """Standard deviation of one reading of a touched frame less the untouched one that came last before it, r.m.s. over
    the readings that are there, or over what a matrix (n, readings) makes of them, in the readings' unit: by untouched
    frames that are as far from each other. It holds whatever lasts, walks or drifts. None of fewer than two."""
    rest, frames = np.flatnonzero(recording.untouched), in_phase(recording.readings)
    if len(rest) < 2:
        return None
    row = np.arange(len(frames))
    away = row - rest[np.maximum(np.searchsorted(rest, row, side="right") - 1, 0)]
    lag = float(np.median(away[away > 0])) if (away > 0).any() else 1.0
    earlier, away_s = rest[:-1], rest[None] - rest[:-1, None]
    later = rest[np.argmin(np.where(away_s > 0, np.abs(away_s - lag), np.inf), axis=1)]
    change = np.where(there, frames[later] - frames[earlier], 0.0)
    unit = np.eye(len(there))[there] if matrix is None else matrix * there
    least = step(frames[rest][:, there]) ** 2 / 6 * np.sum(unit**2) / len(unit)
    return float(np.sqrt(max(_typical(change @ unit.T), least)))


def step(values: Array) -> float:
    """Least difference between values that readings (frames, readings) take, where most values are taken again; 0 where
    they are not, which noise then tells from each other."""
    steps = np.diff(np.sort(values, axis=0), axis=0)
    steps = steps[np.isfinite(steps)]
    changes = steps[steps > 0]
    return float(changes.min()) if 0 < len(changes) < _MOSTLY * len(steps) else 0.0


def _typical(frames: Array) -> float:
    """Mean square of the readings (frames, readings) of frames whose own is no odd one."""
    square = np.nanmean(frames[np.isfinite(frames).any(axis=1)] ** 2, axis=1)
    return float(square[square <= _ODD * np.median(square)].mean())


def _not_empty(frames: Array) -> Array:
    """Frames (frames, readings) with a reading, and readings that some have."""
    there = np.isfinite(frames)
    return frames[there.any(axis=1)][:, there.any(axis=0)]
