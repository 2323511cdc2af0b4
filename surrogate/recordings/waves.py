"""Waves over the plane: a place as a network resolves it, by random Fourier features of two Gaussian kernels (Rahimi
and Recht, Random features for large-scale kernel machines, NIPS 2007)."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array

LENGTHS = (0.5, 0.2)  # of the kernels, over the spread of the training places
EACH = 64  # waves a kernel
NEAR = 3.0  # factor of the place itself, over the spread: it counts as several inputs


@dataclass(frozen=True, eq=False)
class Waves:
    """sqrt(2) cos(p . frequency + phase) of places p about a middle, over their spread."""

    middle: Array  # (2,) mm
    spread: float  # mm
    frequency: Array  # (2, q)
    phase: Array  # (q,)

    def of(self, place: Array) -> Array:
        """(n, 2 + q) the places (n, 2) in mm over the spread, times NEAR, and the waves there."""
        scaled = (place - self.middle) / self.spread
        return np.concatenate([NEAR * scaled, np.sqrt(2) * np.cos(scaled @ self.frequency + self.phase)], axis=1)


def draw_waves(place: Array, seed: int) -> Waves:
    """Waves for places (n, 2) in mm."""
    rng = np.random.default_rng(seed)
    frequency = np.concatenate([rng.standard_normal((2, EACH)) / length for length in LENGTHS], axis=1)
    spread = max(float(place.std(axis=0).mean()), np.finfo(float).tiny)
    return Waves(place.mean(axis=0), spread, frequency, rng.uniform(0, 2 * np.pi, frequency.shape[1]))
