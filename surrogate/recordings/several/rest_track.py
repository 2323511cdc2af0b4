"""What changes slowly, tracked by neighbours in time: weights exp(-|t - t_i| / w), w chosen by leave-one-out error."""

import numpy as np

from touchcal.arrays import Array

FRAMES = (1, 2, 4, 8, 16, 32, 64, 128)  # widths w that are tried, in median steps between frames
PULL = (2.0, 8.0, 32.0)  # weights of "no offset" that are tried, in neighbours at no distance


def step(time: Array) -> float:
    """Median time between frames; 1 where there is none."""
    steps = np.diff(np.sort(time))
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0


def weights(at: Array, known: Array, width: float) -> Array:
    """(n, k) weights of frames at the times known (k,) for the times at (n,); of one frame for itself 0 where both are
    the same array."""
    distance = np.abs(at[:, None] - known) / max(width, np.finfo(float).tiny)
    weight = np.exp(-(distance - (0.0 if at is known else distance.min(axis=1, keepdims=True))))
    if at is known:
        np.fill_diagonal(weight, 0.0)
    return weight


def tracked(weight: Array, frames: Array, pull: float = 0.0) -> Array:
    """(n, m) weighted mean of frames (k, m), drawn to 0 by a pull."""
    total = weight.sum(axis=1, keepdims=True) + pull
    return np.divide(weight @ frames, total, out=np.zeros((len(weight), frames.shape[1])), where=total > 0)


def rest_width(rest: Array, time: Array) -> tuple[float, Array]:
    """The width by which each untouched frame (k, m) is best predicted by the others, and the errors (k, m)."""
    tried = []
    for count in FRAMES:
        width = count * step(time)
        error = rest - tracked(weights(time, time, width), rest)
        tried.append((float(np.sum(error**2)), width, error))
    return min(tried, key=lambda one: one[0])[1:]


def offset_track(residual: Array, time: Array) -> tuple[float, float, Array]:
    """Width and pull by which whitened residuals (n, m) of touched frames are best predicted by the others, and what is
    predicted (n, m): what touched frames share, in their neighbourhood, that untouched ones lack. Width 0 and zeros
    where nothing is predicted."""
    best = (float(np.sum(residual**2)), 0.0, PULL[0], np.zeros_like(residual))
    for count in FRAMES[2:]:
        width = count * step(time)
        weight = weights(time, time, width)
        for pull in PULL:
            offset = tracked(weight, residual, pull)
            best = min(best, (float(np.sum((residual - offset) ** 2)), width, pull, offset), key=lambda one: one[0])
    return best[1:]
