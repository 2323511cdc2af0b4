"""Whether what a touch leaves of a frame is noise and the map's error: as much as these, and shared as these are.

Whitened residuals r of noise that is what the untouched frames say are white. Their energy r'r, and their parts r'B r
by causes B that readings may share (a pattern, an electrode, time, the signals of trained touches), are those of chi^2
of tr(B)^2 / tr(B^2) degrees (Satterthwaite, Biometrics Bull. 2 (1946) 110), of as heavy tails as the noise's. What
the map's own error makes of them is bounded by its share of the energy, all of it along the largest axis of B.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from surrogate.data.reading_noise import ReadingNoise, shared_causes, whitening
from surrogate.data.sensor_ring import Ring
from surrogate.learners.base import Estimate
from touchcal.arrays import Array

# Chance of the noise of a trained touch that is called unlike a touch, and what the map's error may make of a misfit,
# over the worst of the validation rows.
CHANCE, MAP_FACTOR = 2e-3, 1.5
# Most directions of trained signals, as of another touch, of which those count that noise does not hide; and how many
# of them the place and the size of a touch take up.
TOUCHES, TAKEN = 20, 3


@dataclass(frozen=True, eq=False)
class Causes:
    """Causes that residuals may share."""

    matrix: Array  # (k, readings, readings) each of trace 1
    largest: Array  # (k,) largest eigenvalue times the number of readings
    bound: Array  # (k,) r'B r that noise exceeds by CHANCE
    energy: float  # r'r over the number of readings, likewise


def causes_of(ring: Ring, signal_V: Array, noise: ReadingNoise) -> Causes:
    """Causes that readings of a ring may share, the signals (n, readings) of trained touches among them."""
    whitened = signal_V @ whitening(noise)
    unit = whitened / np.linalg.norm(signal_V, axis=1, keepdims=True)
    axes = np.linalg.svd(unit, full_matrices=False)[2][:TOUCHES]
    seen = np.sqrt(np.mean((whitened @ axes.T) ** 2, axis=0)) > noise.white_V
    axes = axes[:max(int(seen.sum()), TAKEN + 1)]
    matrix = np.stack([one / np.trace(one) for one in (*shared_causes(ring), axes.T @ axes)])
    degrees = 1 / np.einsum("kpq,kpq->k", matrix, matrix)
    tails = max(noise.energy_sd**2 * len(noise.root) / 2, 1.0)
    chance, fewer = CHANCE / (len(matrix) + 1), degrees / tails
    whole = len(noise.root) / tails
    free = np.r_[fewer[:-1], max(degrees[-1] - TAKEN, 1.0) / tails]
    return Causes(matrix, np.linalg.eigvalsh(matrix)[:, -1] * len(noise.root), chdtri(free, chance) / fewer,
                  float(chdtri(whole, chance) / whole))


def oddness(causes: Causes, found: Estimate, worst: float) -> Array:
    """(n,) what estimates leave, over what noise and a map whose worst misfit is this leave but by CHANCE."""
    more = found.map_part * (MAP_FACTOR * max(worst, 1.0) - 1)
    whole = found.misfit / (causes.energy * (1 + more))
    if found.left.shape[1] != causes.matrix.shape[1]:  # of no residual, or of fewer channels in a stream
        return whole
    shared = np.einsum("np,kpq,nq->nk", found.left, causes.matrix, found.left, optimize=True)
    by_map = (found.map_part * MAP_FACTOR * max(worst, 1.0))[:, None] * causes.largest
    return np.maximum(whole, (shared / (causes.bound + by_map)).max(axis=1))
