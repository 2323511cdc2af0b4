"""Where one frame's touches lie: for every diameter the place and load that fit best, and a shear that straightens it.

Punches of different d and F have nearly one signal, so that the likelihood is a thin, bent ridge over d. Taking place
and load from those of the ridge at the same diameter makes it straight, and keeps volumes.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from surrogate.statistics.levenberg_marquardt import inverse, minimise
from touchcal.arrays import Array, Index

# Touches (n, 4) as (x, y, log d, g) -> whitened residuals (n, readings) and their slopes (n, readings, 4)
Whitened = Callable[[Array], tuple[Array, Array]]

# Diameters and loads that are tried, steps of each, passes with ever closer diameters, and the cost over the least that
# still counts.
DIAMETERS, LOADS, STEPS, PASSES, COUNTED = 9, 4, 25, 4, 15.0
# Place of log d among the unknowns.
LOG_D = 2
FREE = np.array([0, 1, 3])


@dataclass(frozen=True, eq=False)
class Ridge:
    """The best touches of some diameters."""

    log_d: Array  # (k,) log d, increasing
    best: PchipInterpolator  # log d -> (3,) x, y, g that fit best, mm and 1, smooth between the diameters
    counted: Array  # (m, 4) solutions that count
    spread: Array  # (m, 3, 3) covariances of (x, y, g) there at the same diameter
    reach: float  # half the step between diameters, in log d


def find(whitened: Whitened, centre: Array, log_d: tuple[float, float], load: Callable[[Array], tuple[Array, Array]],
         within: Callable[[Array], Array]) -> Ridge:
    """The ridge of a frame about a start (4,), between two diameters.

    load: lowest and highest g at diameters log d; within: pulls touches (n, 4) back to where they make sense.
    """
    low, high = log_d
    ridge = None
    for _ in range(PASSES):
        ridge, cost = _at(whitened, centre, np.linspace(low, high, DIAMETERS), load, within)
        near = ridge.log_d[cost < cost.min() + COUNTED]
        if len(near) > DIAMETERS // 2 or high - low < 1e-4:
            break
        low, high = max(near.min() - 2 * ridge.reach, log_d[0]), min(near.max() + 2 * ridge.reach, log_d[1])
    assert ridge is not None
    return ridge


def _at(whitened: Whitened, centre: Array, log_d: Array, load: Callable[[Array], tuple[Array, Array]],
        within: Callable[[Array], Array]) -> tuple[Ridge, Array]:
    """The ridge at these diameters and at that of the centre, held between them, and the least cost of each."""
    every = np.unique(np.append(log_d, np.clip(centre[LOG_D], log_d[0], log_d[-1])))
    touch, cost = solutions(whitened, centre, every, load, within)
    by_d = cost.reshape(len(every), -1)
    first = by_d.argmin(axis=1) + by_d.shape[1] * np.arange(len(every))
    kept = np.unique(np.concatenate([first, np.flatnonzero(cost < cost.min() + COUNTED)]))
    kept = kept[cost[kept] < cost.min() + 2 * COUNTED]
    free = whitened(touch[kept])[1][..., FREE]
    spread = inverse(free.transpose(0, 2, 1) @ free + 1e-12 * np.eye(3))
    best = PchipInterpolator(every, touch[first][:, FREE])
    return Ridge(every, best, touch[kept], spread, float(np.diff(every).max()) / 2), by_d.min(axis=1)


def solutions(whitened: Whitened, centre: Array, log_d: Array, load: Callable[[Array], tuple[Array, Array]],
              within: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Touches (m, 4) that each start ends at, LOADS of them and that of the centre for every diameter in turn, and half
    their squared residuals (m,)."""
    share = np.append((np.arange(LOADS) + 0.5) / LOADS, np.nan)
    held = np.repeat(log_d, len(share))
    low, high = load(held)
    start = np.where(np.isnan(np.tile(share, len(log_d))), centre[3], low + np.tile(share, len(log_d)) * (high - low))
    start = np.column_stack([np.tile(centre[:2], (len(held), 1)), start])

    def whole(part: Array, which: Index) -> Array:
        return np.insert(part, LOG_D, held[which], axis=1)

    def residuals(part: Array, which: Index) -> tuple[Array, Array]:
        left, slope = whitened(within(whole(part, which)))
        return left, slope[..., FREE]

    end = minimise(residuals, start, STEPS)
    return within(whole(end.state, np.arange(len(held)))), end.cost


def straightened(ridge: Ridge, unknown: Array) -> Array:
    """Touches (n, 4) as distances from the ridge, log d kept."""
    return _moved(ridge, unknown, -1)


def bent(ridge: Ridge, straight: Array) -> Array:
    """The inverse of `straightened`."""
    return _moved(ridge, straight, 1)


def _moved(ridge: Ridge, touches: Array, sign: int) -> Array:
    out = touches.copy()
    at = np.clip(touches[:, LOG_D], ridge.log_d[0], ridge.log_d[-1])
    out[:, FREE] += sign * ridge.best(at)
    return out


def points_about(ridge: Ridge, count: int, reach: float, rng: np.random.Generator) -> Array:
    """(count or more, 4) straightened touches about the solutions that count, as far as so many standard deviations."""
    each = -(-count // len(ridge.counted))
    root = np.linalg.cholesky(ridge.spread)
    steps = reach * np.einsum("kpq,kmq->kmp", root, rng.normal(size=(len(root), each, 3)))
    points = np.repeat(straightened(ridge, ridge.counted)[:, None], each, axis=1)
    points[..., FREE] += steps
    points[..., LOG_D] += ridge.reach * rng.uniform(-2, 2, size=(len(root), each))
    return points.reshape(-1, 4)
