"""The untouched frame behind each touched one, and how it drifts."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array, Index, Mask

DIRECTIONS = 10  # directions of drift that are kept, at most


@dataclass(frozen=True, eq=False)
class Drift:
    """Random walk of the untouched frame: its change over a time t has covariance t root^T root."""

    root: Array  # (k, m) directions times their standard deviation over one unit of time


def tracked(frames: Array, time: Array, untouched: Mask) -> tuple[Array, Array]:
    """Untouched frame at the time of each touched one, (n, m), by linear interpolation between untouched frames
    (n_frames, m), the smoother of a random walk read without noise; the nearest one outside them. And (n,) the time
    from each touched frame to the nearest untouched one."""
    return interpolated(frames[untouched], time[untouched], time[~untouched])


def interpolated(rest: Array, known: Array, at: Array) -> tuple[Array, Array]:
    """(n, m) untouched frames (k, m) of these times interpolated at others (n,), held outside; and (n,) the time to the
    nearest one."""
    after = np.clip(np.searchsorted(known, at), 0, len(known) - 1)
    before = np.maximum(after - (known[after] >= at), 0)
    width = known[after] - known[before]
    share = np.clip(np.divide(at - known[before], width, out=np.zeros(len(at)), where=width > 0), 0, 1)
    frame = rest[before] + share[:, None] * (rest[after] - rest[before])
    return frame, np.minimum(np.abs(at - known[before]), np.abs(known[after] - at))


def learn_drift(frames: Array, time: Array) -> Drift:
    """Main directions in which untouched frames (k, m) move from one to the next; none from fewer than three."""
    step = np.diff(time)
    moved = step > 0
    change = np.diff(frames, axis=0)[moved] / np.sqrt(step[moved])[:, None]
    if len(change) < 2:
        return Drift(np.zeros((0, frames.shape[1])))
    _, size, axes = np.linalg.svd(change, full_matrices=False)
    return Drift((size[:, None] * axes)[:DIRECTIONS] / np.sqrt(len(change)))


def without(drift: Drift, signal: Array, count: int) -> Array:
    """Signals (n, m) less what lies along the first `count` directions of drift."""
    root = drift.root[:count]
    axes = root / np.linalg.norm(root, axis=1, keepdims=True)
    return signal - signal @ axes.T @ axes


def in_order(index: Index, time_s: Array | None) -> Array:
    """(frames,) time of each frame in s, or its index where there is no clock."""
    return np.asarray(index if time_s is None else time_s, float)
