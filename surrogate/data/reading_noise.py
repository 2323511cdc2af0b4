"""Noise of the readings of a frame, each with the others: what untouched frames show of it.

Causes that are foreseen: white noise; noise in proportion to the reading, of one reading, of a current pattern or the
whole frame (current), of one electrode (gain); noise common to a pattern (its reference electrode) or a frame; noise of
one electrode wherever it is read; noise that lasts over some readings in their order. Others count as far as the frames
show them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.covariance_components import covariance
from surrogate.data.sensor_ring import Ring
from touchcal.arrays import Array, Mask

LASTING = (2.0, 6.0, 20.0, 60.0)  # readings over which noise may last
FEWEST = 8  # frames from which a covariance is learnt; of fewer one variance
FOLDS = 4  # parts of the frames, each foreseen by the others
NULL = 1e-3  # part of the smallest variance below which one more is none


@dataclass(frozen=True, eq=False)
class ReadingNoise:
    """Covariance white_V^2 I + root root' of the noise of a signal."""

    white_V: float
    root: Array  # (readings, k) V
    # standard deviation of the energy of a whitened frame over the number of its readings
    energy_sd: float

    @property
    def rms_V(self) -> float:
        """Standard deviation of a reading, r.m.s."""
        return float(np.sqrt(self.white_V**2 + np.sum(self.root**2) / len(self.root)))

    @property
    def covariance(self) -> Array:
        """(readings, readings) V^2."""
        return self.white_V**2 * np.eye(len(self.root)) + self.root @ self.root.T

    def of(self, kept: Mask) -> ReadingNoise:
        """That of the readings that are kept, a mask."""
        return replace(self, root=self.root[kept], energy_sd=self.energy_sd * float(np.sqrt(len(kept) / kept.sum())))

    def times(self, factor: float) -> ReadingNoise:
        """That of all readings multiplied by one factor."""
        return replace(self, white_V=factor * self.white_V, root=factor * self.root)

    def scaled(self, gain: Array) -> ReadingNoise:
        """That of readings multiplied by factors (readings,)."""
        if np.all(gain == 1):
            return self
        return _split(self.covariance * np.outer(gain, gain), self.energy_sd)

    @property
    def largest(self) -> ReadingNoise:
        """With the directions alone in which it is more than twice as large as white; the rest counts as white."""
        axes, size, _ = np.linalg.svd(self.root, full_matrices=False)
        kept = size > self.white_V
        rest = float(np.sum(size[~kept] ** 2)) / len(self.root)
        return replace(self, white_V=float(np.sqrt(self.white_V**2 + rest)), root=axes[:, kept] * size[kept])

    def draws(self, count: int, rng: np.random.Generator) -> Array:
        """(count, readings) frames of it, V."""
        white = self.white_V * rng.normal(size=(count, len(self.root)))
        return white + rng.normal(size=(count, self.root.shape[1])) @ self.root.T if self.root.size else white


def white_noise(sd_V: float, readings: int) -> ReadingNoise:
    """Independent noise of one standard deviation, V."""
    return ReadingNoise(sd_V, np.zeros((readings, 0)), float(np.sqrt(2 / readings)))


def noise_of(frames: Array, ring: Ring | None) -> ReadingNoise | None:
    """The noise of one frame by untouched frames (n, readings), V; of one variance for fewer than FEWEST, None for
    one. Dead channels are NaN, and count as of no noise."""
    n = len(frames)
    if n < 2:
        return None
    off = np.nan_to_num(frames - frames.mean(axis=0))
    if n < FEWEST or not np.any(off):
        return white_noise(float(np.sqrt(np.nanmean(frames.var(axis=0, ddof=1)))), frames.shape[1])
    there = np.all(np.isfinite(frames), axis=0) & np.any(off != 0, axis=0)
    return by_scatter(off, n - 1.0, np.nan_to_num(frames.mean(axis=0)), ring, there)


def by_scatter(off: Array, degrees: float, untouched_V: Array, ring: Ring | None, there: Mask) -> ReadingNoise:
    """The noise by frames (n, readings), V, of mean zero and of so many degrees of freedom together, of channels that
    are there."""
    foreseen = [one[np.ix_(there, there)] for one in _foreseen(untouched_V, ring)]
    seen = off[:, there]
    found = covariance(seen, degrees, foreseen)
    more, energy_sd = _held_out(seen, degrees / len(off), foreseen)
    whole = np.zeros((len(there), len(there)))
    whole[np.ix_(there, there)] = found * more
    whole[~there, ~there] = float(np.mean(np.diag(found)))
    return _split(whole, energy_sd)


def whitening(noise: ReadingNoise) -> Array:
    """(readings, readings) inverse root of the covariance over its largest entry; the identity without noise."""
    if not noise.root.size:
        return np.eye(len(noise.root))
    axes, size, _ = np.linalg.svd(noise.root, full_matrices=False)
    shrink = 1 - noise.white_V / np.hypot(noise.white_V, size)
    return np.eye(len(axes)) - (axes * shrink) @ axes.T


def _held_out(seen: Array, share: float, foreseen: list[Array]) -> tuple[float, float]:
    """Energy of frames whitened by the covariance of others, over that expected, at least 1, and its standard
    deviation, at least that of chi^2."""
    energies, p = [], seen.shape[1]
    parts = np.array_split(np.arange(len(seen)), FOLDS)
    for part in parts:
        others = np.delete(seen, part, axis=0)
        left = np.linalg.solve(covariance(others, share * len(others), foreseen), seen[part].T)
        energies.append(np.einsum("np,pn->n", seen[part], left) / (share * p))
    energy = np.concatenate(energies)
    more = max(float(energy.mean()), 1.0)
    return more, max(float(energy.std()) / more, float(np.sqrt(2 / p)))


def _split(whole: Array, energy_sd: float) -> ReadingNoise:
    part, axes = np.linalg.eigh(whole)
    least = float(max(part[0], np.finfo(float).eps * part[-1]))
    kept = part - least > NULL * least
    return ReadingNoise(float(np.sqrt(least)), axes[:, kept] * np.sqrt(part[kept] - least), energy_sd)


def _foreseen(untouched_V: Array, ring: Ring | None) -> list[Array]:
    unit = untouched_V / max(float(np.sqrt(np.mean(untouched_V**2))), np.finfo(float).tiny)
    both = np.outer(unit, unit)
    own = [np.eye(len(unit)), np.diag(unit**2), both, *_by_order(len(unit))]
    if ring is None:
        return own
    pattern, electrode = _by_electrodes(ring)
    return [*own, pattern, electrode, both * pattern, both * (ring.read[:, None] == ring.read)]


def shared_causes(ring: Ring) -> tuple[Array, ...]:
    """Covariances (readings, readings) by what readings of a ring share: frames, what lasts over their order, patterns,
    electrodes."""
    return (*_by_order(len(ring.read)), *_by_electrodes(ring))


def _by_order(readings: int) -> tuple[Array, ...]:
    apart = np.abs(np.subtract.outer(np.arange(readings), np.arange(readings)))
    return (np.ones((readings, readings)), *(np.exp(-apart / length) for length in LASTING))


def _by_electrodes(ring: Ring) -> tuple[Array, Array]:
    rows = np.arange(len(ring.read))
    pattern = np.unique(np.column_stack([ring.source, ring.sink]), axis=0, return_inverse=True)[1].ravel()
    electrode = np.zeros((len(rows), len(ring.angle_rad)))
    electrode[rows, ring.read] += 1
    electrode[rows, ring.ground] -= 1
    return (pattern[:, None] == pattern).astype(float), electrode @ electrode.T
