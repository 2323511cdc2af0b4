"""Where a touch is and how strong its multipoles are, before asking which punch made them."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from surrogate.forward_map import multipole_series
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.forward_map import place as scaled_place
from surrogate.statistics.levenberg_marquardt import inverse, minimise
from touchcal.arrays import Array, Index

# Candidate places, how many of the best go on, and the steps that each is given.
CANDIDATES, PLACES, STEPS = 400, 2, 15
MARGIN_MM, MARGIN = 10.0, 0.1  # how far outside the training touches one may lie: its place, mm, and log d and log F
RIM = 0.97  # part of the disc's radius outside which no place is sought
# Least part of what is known of a strength, the prior of the search with it, that the signal is taken to tell.
LEAST_KNOWN = 1e-6


@dataclass(frozen=True)
class Located:
    """Touches by place and strengths."""

    place_mm: Array  # (n, 2) x, y, mm
    strengths: Array  # (n, orders) log |p_1 / V|, p_2 / p_1 ... by the signal alone
    covariance: Array  # (n, orders, orders) their covariance by the signal alone


def locate(forward: ForwardMap, signal: Array, sd: Array) -> Located:
    """Fit place and free strengths to signals (n, readings) of standard deviation sd (n,) a reading, V.

    The ratios of the strengths are held by a prior as wide as the training touches, so that noise cannot blow them up;
    it is taken out of what is returned, which is a likelihood.
    """
    starts = _starts(forward, signal)
    frames = np.repeat(np.arange(len(signal)), PLACES)
    size = np.abs(starts[:, 2])

    def residuals(state: Array, which: Index) -> tuple[Array, Array]:
        return _residuals(forward, signal[frames[which]], sd[frames[which]], size[which], state)

    found = minimise(residuals, starts, STEPS,
                     lambda state: np.column_stack([on_disc(forward, state[:, :2]), state[:, 2:]]))
    best = np.argmin(found.cost.reshape(-1, PLACES), axis=1) + PLACES * np.arange(len(signal))
    return _as_ratios(forward, found.state[best], inverse(found.normal[best])[:, 2:, 2:], size[best])


def _starts(forward: ForwardMap, signal: Array) -> Array:
    """(n PLACES, 2 + orders) states: the candidates whose dipole patterns match best."""
    place, direction, size = candidates(forward, CANDIDATES)
    match = signal @ direction.T
    chosen = np.argsort(-match, axis=1)[:, :PLACES]
    dipole = np.take_along_axis(match, chosen, axis=1) / size[chosen]
    least = 1e-3 * np.exp(forward.strengths[0].values.min())
    dipole = forward.sign * np.maximum(dipole, least).reshape(-1, 1)
    return np.column_stack([place[chosen.ravel()], dipole, dipole * _ratios(forward)[0]])


@lru_cache(maxsize=8)
def candidates(forward: ForwardMap, count: int) -> tuple[Array, Array, Array]:
    """Places (count, 2) of a sunflower spiral, mm, directions (count, readings) of dipoles' signals there, norms."""
    i = np.arange(count) + 0.5
    angle = np.pi * (1 + np.sqrt(5)) * i
    place = (forward.bounds[1, 0] * np.sqrt(i / count) * np.array([np.cos(angle), np.sin(angle)])).T
    drive, read = multipole_series.patterns(forward.ring, forward.field, scaled_place(forward.ring, place), 1)
    pattern = multipole_series.basis(drive, read)[..., 0] * forward.sign
    size = np.linalg.norm(pattern, axis=1)
    return place, pattern / size[:, None], size


def _ratios(forward: ForwardMap) -> tuple[Array, Array]:
    """Mean and spread (orders - 1,) of p_n / p_1 over the training touches."""
    values = [process.values for process in forward.strengths[1:]]
    return np.array([v.mean() for v in values]), np.array([2 * v.std() for v in values])


def _residuals(forward: ForwardMap, signal: Array, sd: Array, size: Array, state: Array) -> tuple[Array, Array]:
    z = scaled_place(forward.ring, state)
    fields = multipole_series.electrode_fields(forward.ring, forward.field, z, multipole_series.ORDERS + 1)
    base, by_x, by_y = multipole_series.basis_and_slopes(forward.ring, fields)
    strength = state[:, 2:]
    slopes = [multipole_series.combined(by, strength) / forward.ring.radius_mm for by in (by_x, by_y)]
    jacobian = np.concatenate([np.stack(slopes, axis=2), base], axis=2) / sd[:, None, None]
    residual = (multipole_series.combined(base, strength) - signal) / sd[:, None]
    mean, spread = _ratios(forward)
    held = (strength[:, 1:] - mean * strength[:, :1]) / (spread * size[:, None])
    holds = np.zeros((len(state), len(mean), state.shape[1]))
    holds[:, :, 2] = -mean / (spread * size[:, None])
    holds[:, np.arange(len(mean)), np.arange(3, state.shape[1])] = 1 / (spread * size[:, None])
    return np.concatenate([residual, held], axis=1), np.concatenate([jacobian, holds], axis=1)


def on_disc(forward: ForwardMap, place_mm: Array) -> Array:
    """Places (n, 2) pulled back to the training touches and a margin about them."""
    limit = min(forward.bounds[1, 0] + MARGIN_MM, RIM * forward.ring.radius_mm)
    radius = np.hypot(place_mm[:, 0], place_mm[:, 1])
    return place_mm * np.minimum(1.0, limit / np.maximum(radius, 1e-12))[:, None]


def on_range(forward: ForwardMap, unknown: Array) -> Array:
    """Touches (n, 4) as (x, y, log d, g) held to the training touches and a margin about them."""
    held = unknown.copy()
    held[:, :2] = on_disc(forward, unknown[:, :2])
    (d_lo, f_lo), (d_hi, f_hi) = forward.bounds[:, 1:] * np.exp(MARGIN * np.array([[-1], [1]]))
    held[:, 2] = np.clip(unknown[:, 2], np.log(d_lo), np.log(d_hi))
    area = np.exp(2 * held[:, 2]) * forward.p0
    held[:, 3] = np.clip(unknown[:, 3], np.arcsinh(f_lo / area), np.arcsinh(f_hi / area))
    return held


def _as_ratios(forward: ForwardMap, state: Array, covariance: Array, size: Array) -> Located:
    strength = state[:, 2:]
    weakest = 1e-6 * np.exp(forward.strengths[0].values.min())
    first = forward.sign * np.maximum(forward.sign * strength[:, 0], weakest)
    slope = np.zeros_like(covariance)
    slope[:, 0, 0] = 1 / first
    rest = np.arange(1, strength.shape[1])
    slope[:, rest, 0] = -strength[:, 1:] / first[:, None] ** 2
    slope[:, rest, rest] = 1 / first[:, None]
    values = np.column_stack([np.log(np.abs(first)), strength[:, 1:] / first[:, None]])
    mean, spread = _ratios(forward)
    prior = (first / size)[:, None] / spread
    return Located(state[:, :2], *_by_signal_alone(values, slope @ covariance @ slope.transpose(0, 2, 1), mean, prior))


def _by_signal_alone(values: Array, covariance: Array, mean: Array, prior: Array) -> tuple[Array, Array]:
    """Means (n, k) and covariances (n, k, k) of the normal likelihoods that make these posteriors of a normal prior of
    all values but the first, of this mean (k - 1,) and these roots of its precisions (n, k - 1)."""
    precision = inverse(covariance)
    scale = np.sqrt(np.einsum("npp->np", precision))
    known_part = precision / scale[:, :, None] / scale[:, None, :]
    held = np.zeros_like(values)
    held[:, 1:] = (prior / scale[:, 1:]) ** 2
    right = (known_part @ (scale * values)[..., None])[..., 0]
    right[:, 1:] -= held[:, 1:] * scale[:, 1:] * mean
    part, axes = np.linalg.eigh(known_part - held[:, :, None] * np.eye(values.shape[1]))
    spread = (axes / np.maximum(part, LEAST_KNOWN)[:, None]) @ axes.transpose(0, 2, 1)
    return (spread @ right[..., None])[..., 0] / scale, spread / scale[:, :, None] / scale[:, None, :]
