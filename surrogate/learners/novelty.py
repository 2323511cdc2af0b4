"""Whether a signal looks like those of the calibration rows, for learners that do not model signals."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from surrogate.data.reading_noise import ReadingNoise
from surrogate.data.sensor_ring import Ring, impedances_read
from touchcal.arrays import Array, Index, Mask

MOST = 80  # principal directions that trained signals are made of, where twice as many rows tell them
# Part of a signal outside its span that is never strange: what rounding in a file of six digits may make.
LEAST = 1e-3
# What the span leaves of a signal from which it is strange, over that of the worst trained one, and of noise by chance.
FACTOR, CHANCE = 3.0, 1e-3
SURE = 3.0  # standard deviations of noise from which a sign is sure
# Standard deviations of noise from which a column is seen in a signal, and part of what is strange that it explains.
CLEAR, EXPLAINED = 6.0, 0.8


@dataclass(frozen=True, eq=False)
class Novelty:
    """The span of the directions of some signals."""

    axes: Array  # (k, readings) orthonormal directions
    worst: float  # what they leave of the worst held-out direction
    mean: Array  # (readings,) mean direction, zero where signals point both ways
    least: float  # least inner product of a direction with the mean one
    strongest_V: float  # norm of the strongest signal, V


def fit_novelty(ring: Ring, signal_V: Array) -> Novelty:
    """Span of the directions of signals (n, readings) in V of a ring: of every other row, the rest tells how much it
    leaves; of few rows all that a symmetric impedance matrix can read."""
    size = np.linalg.norm(signal_V, axis=1)
    unit = signal_V / size[:, None]
    axes = np.linalg.svd(unit[::2], full_matrices=False)[2][:MOST] if len(unit) >= 4 * MOST else reciprocal(ring).T
    mean = unit.mean(axis=0)
    least = max(float((unit @ mean).min()), 0.0)
    return Novelty(axes, max(float(_left(axes, unit[1::2] if len(unit) > 1 else unit).max()), LEAST),
                   mean if least > 0 else np.zeros_like(mean), least, float(size.max()))


def with_directions(novelty: Novelty, root: Array) -> Novelty:
    """The novelty of signals to which any combination of the columns of root (readings, k) may be added."""
    axes, size, _ = np.linalg.svd(np.hstack([novelty.axes.T, root / max(np.linalg.norm(root), np.finfo(float).tiny)]),
                                  full_matrices=False)
    return replace(novelty, axes=axes[:, size > 1e-9 * size[0]].T)


def one_column(novelty: Novelty, signal_V: Array, columns: Array, noise_V: float) -> tuple[Index, Array, Mask]:
    """Of columns (readings, k) the one (n,) that explains most of what the span leaves of signals (n, readings), its
    factor, and whether it is clear of noise and explains EXPLAINED of what is more than expected in the squares, where
    anything is."""
    left, free = (rows - rows @ novelty.axes.T @ novelty.axes for rows in (signal_V, columns.T))
    size = np.maximum(np.sum(free**2, axis=1), np.finfo(float).tiny)
    along = left @ free.T
    best = np.argmax(along**2 / size, axis=1)
    factor = np.take_along_axis(along / size, best[:, None], axis=1)[:, 0]
    explained = factor**2 * size[best]
    more = np.sum(left**2, axis=1) - expected_left(novelty, signal_V, noise_V) ** 2
    clear = (explained > (CLEAR * noise_V) ** 2) & (more > 0)
    return best, factor, clear & (explained > EXPLAINED * more)


def expected_left(novelty: Novelty, signal_V: Array, noise_V: float) -> Array:
    """(n,) norm, V, that the span is expected to leave of signals (n, readings)."""
    free = max(signal_V.shape[1] - len(novelty.axes), 0)
    return np.sqrt((novelty.worst * np.linalg.norm(signal_V, axis=1)) ** 2 + free * noise_V**2)


def reciprocal(ring: Ring, kept: Mask | None = None) -> Array:
    """(readings, k) orthonormal readings of symmetric impedance matrices, since driving and reading may be exchanged;
    of some readings, a mask, where given."""
    read = impedances_read(ring, np.arange(len(ring.angle_rad)))
    axes, singular, _ = np.linalg.svd(read if kept is None else read[kept], full_matrices=False)
    return axes[:, singular > 1e-9 * singular[0]]


def novelty_score(novelty: Novelty, signal_V: Array, noise: ReadingNoise) -> Array:
    """(n,) what the span leaves of signals (n, readings), over FACTOR times what it leaves of the worst trained one and
    what it leaves of noise but in CHANCE of frames; infinite for a signal of the other sign than all trained ones."""
    size = np.maximum(np.linalg.norm(signal_V, axis=1), np.finfo(float).tiny)
    unit = signal_V / size[:, None]
    most = np.hypot(FACTOR * novelty.worst * size, _noise_left_V(novelty, noise))
    return np.where(unit @ novelty.mean < 0, np.inf, _left(novelty.axes, unit) * size / most)


def _noise_left_V(novelty: Novelty, noise: ReadingNoise) -> float:
    """Norm, V, that the span leaves of noise but in CHANCE of frames: of chi^2 of as many degrees as make its mean and
    variance (Satterthwaite, Biometrics Bull. 2 (1946) 110), and of tails as heavy as the noise's."""
    root = noise.root - novelty.axes.T @ (novelty.axes @ noise.root)
    free = max(len(noise.root) - len(novelty.axes), 1)
    part = np.linalg.eigvalsh(root.T @ root) if root.size else np.zeros(0)
    mean = free * noise.white_V**2 + float(part.sum())
    square = free * noise.white_V**4 + float(np.sum(part * (part + 2 * noise.white_V**2)))
    if not mean:
        return 0.0
    tails = max(noise.energy_sd**2 * len(noise.root) / 2, 1.0)
    degrees = mean**2 / square / tails
    return float(np.sqrt(mean * chdtri(degrees, CHANCE) / degrees))


def of_other_sign(novelty: Novelty, signal_V: Array, noise_V: float) -> Mask:
    """(n,) whether signals (n, readings) point away from all trained ones as trained ones do when reversed, at least
    half as much and by more than noise may: a touch elsewhere may be at a right angle to them."""
    along, size = signal_V @ novelty.mean, np.linalg.norm(signal_V, axis=1)
    return along < -np.maximum(SURE * noise_V * np.linalg.norm(novelty.mean), novelty.least / 2 * size)


def _left(axes: Array, unit: Array) -> Array:
    return np.linalg.norm(unit - unit @ axes.T @ axes, axis=1)
