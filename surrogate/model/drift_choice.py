"""Which gains drifted between the frames, by what no touch explains of a signal.

What the touches' span leaves of a signal is noise of standard deviation s in each free direction, and what drifted. No
gain, one gain and all gains compete by chi^2 + k ln n (Schwarz, Ann. Stat. 6 (1978) 461, DOI
10.1214/aos/1176344136). Gains that are not chosen keep the standard deviation that the signal may hide: one standard
error, where that is less than the stated one.
"""

from collections.abc import Iterator

import numpy as np

from surrogate.data.frame_drift import FrameDrift
from surrogate.learners.novelty import Novelty, expected_left
from touchcal.arrays import Array, Index


def drift_groups(drift: FrameDrift, span: Novelty, signal_V: Array, noise_V: float) -> Iterator[tuple[Index, Array]]:
    """Frames of signals (n, readings) by the gains that drifted, each group with its root (readings, k), V."""
    count = drift.gain.shape[1]
    if not count:
        yield np.arange(len(signal_V)), drift.root
        return
    left, free = (rows - rows @ span.axes.T @ span.axes for rows in (signal_V, drift.gain.T))
    size = np.maximum(np.linalg.norm(free, axis=1), np.finfo(float).tiny)
    dimensions = max(signal_V.shape[1] - len(span.axes), 1)
    sd = np.maximum(expected_left(span, signal_V, noise_V) / np.sqrt(dimensions), np.finfo(float).tiny)
    choice = _choice(left / sd[:, None], free / size[:, None])
    for one in np.unique(choice):
        rows = np.flatnonzero(choice == one)
        hidden = np.minimum(1.0, float(np.median(sd[rows])) / size)
        factor = np.ones(count) if one == count else np.where(np.arange(count) == one, 1.0, hidden)
        yield rows, np.hstack([drift.gain * factor, drift.contact])


def _choice(left: Array, columns: Array) -> Index:
    """(n,) of signals (n, readings) in standard deviations: -1 where no column (k, readings) of norm 1 explains them,
    the number of the one that does, or k for all of them."""
    penalty, count = np.log(left.shape[1]), len(columns)
    single = np.max((left @ columns.T) ** 2, axis=1)
    axes = np.linalg.svd(columns.T, full_matrices=False)[0]
    every = np.sum((left @ axes) ** 2, axis=1)
    gained = np.stack([np.zeros(len(left)), single - penalty, every - count * penalty])
    best, one = np.argmax(gained, axis=0), np.argmax((left @ columns.T) ** 2, axis=1)
    return np.choose(best, [np.full(len(left), -1), one, np.full(len(left), count)])
