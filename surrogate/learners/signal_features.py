"""Features of a signal: the whitened direction dV / |dV|, which hardly depends on its size, and log |dV|."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array


@dataclass(frozen=True)
class Directions:
    """Principal directions of the training signals' directions."""

    mean: Array  # (readings,) mean direction
    axes: Array  # (k, readings) principal axes, each over the standard deviation along it
    log_mean: float  # mean of log(|dV| / V)
    log_sd: float  # its standard deviation


def fit_directions(signal_V: Array, components: int) -> Directions:
    """Directions of signals (n, readings), cut to the `components` of most variance."""
    size = np.linalg.norm(signal_V, axis=1)
    direction = signal_V / size[:, None]
    mean = direction.mean(0)
    _, singular, axes = np.linalg.svd(direction - mean, full_matrices=False)
    if singular[0] <= 1e-12 * np.sqrt(len(signal_V)):
        raise ValueError(f"{len(signal_V)} training rows hold one signal, up to its size; there is nothing to learn "
                         "from. Sweep different touches.")
    kept = min(components, int(np.sum(singular > 1e-10 * singular[0])))
    sd = singular[:kept] / np.sqrt(len(signal_V))
    log = np.log(size)
    return Directions(mean, axes[:kept] / sd[:, None], float(log.mean()), max(float(log.std()), 1e-9))


def features(directions: Directions, signal_V: Array) -> Array:
    """(n, k + 1) whitened direction, then standardised log size; ValueError for a signal of size zero."""
    size = np.linalg.norm(signal_V, axis=1)
    if not np.all(size > 0):
        raise ValueError(f"frame {int(np.argmin(size))} equals the untouched one; it has no touch to read.")
    along = (signal_V / size[:, None] - directions.mean) @ directions.axes.T
    return np.column_stack([along, (np.log(size) - directions.log_mean) / directions.log_sd])


def sound_components(signal_V: Array, most: int) -> int:
    """How many directions, at most so many, stand out of white noise in signals (n, readings).

    Signals of pairs that drive and read take half of all directions (reciprocity), so the lower half of their variances
    is noise; a direction counts where its variance is above twice that. Without noise all of them count.
    """
    direction = signal_V / np.linalg.norm(signal_V, axis=1)[:, None]
    variance = np.linalg.svd(direction - direction.mean(0), compute_uv=False) ** 2
    noise = np.median(variance[len(variance) // 2:])
    return max(1, min(most, int(np.sum(variance > 2 * noise))))


def carried(directions: Directions, signal_V: Array, slope: Array, noise_V: float) -> Array:
    """(n, outputs) variance that noise on the readings makes of outputs of slopes (n, outputs, k + 1) by features."""
    if noise_V == 0:
        return np.zeros(slope.shape[:2])
    return noise_V**2 * np.sum(by_signal(directions, signal_V, slope) ** 2, axis=2)


def by_signal(directions: Directions, signal_V: Array, slope: Array) -> Array:
    """(n, outputs, readings) derivatives by the signal, per V, from slopes (n, outputs, k + 1) by the features."""
    size = np.linalg.norm(signal_V, axis=1)[:, None]
    unit = signal_V / size
    along, by_size = slope[..., :-1], slope[..., -1]
    radial = by_size / directions.log_sd - np.einsum("nok,nk->no", along, unit @ directions.axes.T)
    return (along @ directions.axes + radial[..., None] * unit[:, None, :]) / size[..., None]
