"""What readings are uncertain by: white noise, drifts of the instrument between its frames, and the map's own error,
which readings near the rim share.

The covariance white^2 I + U diag(sd^2) U' of each frame has orthonormal U of few columns, so that residuals are
whitened by one product with them.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from surrogate.forward_map import polarization, rim_covariance
from surrogate.forward_map.forward_map import ForwardMap, gap, place, reaches
from touchcal.arrays import Array, Index

# Standard deviations outside a bound from which it is not believed, as far as errors of the map make one in a hundred
# touches err; and that count as far within.
DOUBTED, FAR = 5.0, 30.0


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of the readings of some frames."""

    white: Array  # (n,) standard deviation of what is white, V
    # (n or 1, readings, k) orthonormal directions of the rest, the same for all frames where there is one set of them,
    # and (n, k) the part of a component that whitening takes off
    axes: Array
    shrink: Array


@dataclass(frozen=True, eq=False)
class Drift:
    """What may change of the readings between the untouched and the touched frame, the same for all frames."""

    axes: Array  # (readings, k) orthonormal directions
    sd: Array  # (k,) standard deviation along each, V


def drift_of(root: Array) -> Drift:
    """The drift of covariance root root', of a root (readings, k), V."""
    axes, sd, _ = np.linalg.svd(root, full_matrices=False)
    known = sd > np.finfo(float).eps * sd.max(initial=0.0) * len(root)
    return Drift(axes[:, known], sd[known])


@lru_cache(maxsize=64)
def no_drift(readings: int) -> Drift:
    """None of that many readings."""
    return Drift(np.zeros((readings, 0)), np.zeros(0))


def white(sd: Array, drift: Drift) -> Uncertainty:
    """White noise of standard deviations sd (n,), V, and a drift."""
    return Uncertainty(sd, drift.axes[None], 1 - sd[:, None] / np.hypot(sd[:, None], drift.sd))


def at(forward: ForwardMap, unknown: Array, size: Array, noise_V: float, drift: Drift) -> Uncertainty:
    """White noise noise_V, a drift and the map's error at touches (n, 4) given as (x, y, log d, g), for signals of
    these sizes (n,), V."""
    floor, axes, sd = own_error(forward, unknown, size)
    whole = np.hypot(noise_V, floor)
    if not np.any(sd):
        return white(whole, drift)
    if drift.sd.size:
        each = np.broadcast_to(drift.axes * drift.sd, (len(whole), *drift.axes.shape))
        axes, sd, _ = np.linalg.svd(np.concatenate([axes * sd[:, None], each], axis=2), full_matrices=False)
    return Uncertainty(whole, axes, 1 - whole[:, None] / np.hypot(whole[:, None], sd))


def own_error(forward: ForwardMap, unknown: Array, size: Array) -> tuple[Array, Array, Array]:
    """The map's own error at such touches: standard deviation (n,) of what is white, V, orthonormal axes (n, readings,
    k) of the rest, and standard deviations (n, k) along these, V."""
    ring, fitted = forward.ring, forward.correction
    floor, z = forward.floor * np.sqrt(ring.copies) * size, place(ring, unknown)
    near = reaches(forward, z)
    directions = fitted.error.directions
    axes, sd = np.zeros((len(z), len(ring.read), directions)), np.zeros((len(z), directions))
    if np.any(near):
        gaps = gap(ring, unknown[near])
        norm = rim_covariance.size_at(fitted.error, gaps, unknown[near, 3]) * size[near]
        axes[near], along, rest = _shared(forward, unknown[near], gaps)
        sd[near] = along * norm[:, None]
        left = norm * np.sqrt(rest / len(fitted.rim.fill))
        floor[near] = np.hypot(left * np.sqrt(ring.copies), floor[near])
    return floor, axes, sd


def _shared(forward: ForwardMap, unknown: Array, gaps: Array) -> tuple[Array, Array, Array]:
    """Where errors over their norm lie near an edge, as `rim_covariance.spread`."""
    z, error = place(forward.ring, unknown), forward.correction.error
    if error.answer is None:
        return rim_covariance.spread(error, z, gaps)
    design = polarization.products(forward.ring, forward.fields(z)[:polarization.ERROR], z, unknown[:, 2])
    return rim_covariance.spread_of_answer(error, design, gaps)


def whitened(sd: Uncertainty, values: Array) -> Array:
    """Values (n, readings, q) in V times the inverse root of the covariance."""
    left = values - sd.axes @ (sd.shrink[..., None] * (sd.axes.transpose(0, 2, 1) @ values))
    left /= sd.white[:, None, None]
    return left


def of(sd: Uncertainty, frames: Index) -> Uncertainty:
    """Those of some frames."""
    return Uncertainty(sd.white[frames], sd.axes if len(sd.axes) == 1 else sd.axes[frames], sd.shrink[frames])


def white_part(sd: Uncertainty, own_V: Array) -> Array:
    """(n,) the part that white errors of standard deviations own_V (n,), V, among these, have in the energy of whitened
    readings."""
    readings, count = sd.axes.shape[1:]
    return (own_V / sd.white) ** 2 * (readings - count + np.sum((1 - sd.shrink) ** 2, axis=1)) / readings


def truncated_normal_mean(mean: Array, covariance: Array, column: int, lowest: float, highest: float) -> Array:
    """Means (n, p) of normal estimates of covariances (n, p, p) where one column is known to lie in [lowest, highest],
    the others by their regression on it; as they are where it is DOUBTED standard deviations outside (Johnson, Kotz,
    Balakrishnan, Continuous Univariate Distributions 1, 1994, section 13.10.1)."""
    sd = np.sqrt(np.maximum(covariance[:, column, column], np.finfo(float).tiny))
    below, above = (lowest - mean[:, column]) / sd, (highest - mean[:, column]) / sd
    believed = (below < DOUBTED) & (above > -DOUBTED)
    below, above = np.clip(below, -FAR, DOUBTED), np.clip(above, -DOUBTED, FAR)
    mass = np.where(below > 0, ndtr(-below) - ndtr(-above), ndtr(above) - ndtr(below))
    shift = (np.exp(-0.5 * below**2) - np.exp(-0.5 * above**2)) / np.sqrt(2 * np.pi)
    shift = np.where(believed, shift / np.maximum(mass, np.finfo(float).tiny), 0.0)
    return mean + covariance[..., column] * (shift / sd)[:, None]
