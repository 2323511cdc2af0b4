"""The map from place to pattern, read by its likelihood: a Gaussian process gives the pattern of a press at each place
of a grid, and a new pattern is read by the places whose templates explain it.

Patterns of n presses at places p_i are u_i = m + f(p_i) + e_i, f a process of Matern-5/2 kernel in the plane, the same
for all readings up to a common factor, e of covariance R over the readings. R comes from leave-one-out residuals, which
hold the noise and the error of the map; it is shrunk towards a multiple of the unit matrix, and the log likelihood is
tempered, since residuals are not quite normal: both are chosen by reading held-out blocks. Places are read no finer
than the grid, an eightieth of the disc of the training places, whose spacing the standard deviation includes.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from surrogate.recordings.patterns import compressed, compression_scale, direction
from surrogate.statistics.gaussian_process import spread_evenly, squared_distance
from touchcal.arrays import Array, Index

LENGTHS = (0.3, 0.45, 0.65, 1.0, 1.4, 2.0)  # lengths tried, over the spread of the places along an axis
NOISES = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)  # variances of noise tried, over that of the process
SHRINKS = (0.02, 0.1, 0.3, 0.9)  # parts of R that are a multiple of the unit matrix
TEMPERS = (1.0, 0.3, 0.1, 0.03)  # factors of the log likelihood
MOST_SEARCHED, MOST_ROWS = 500, 2000  # rows that length and noise are chosen on; rows that are kept, the latest
ACROSS, MARGIN = 80, 1.05  # points of the grid across the disc about the places, and its radius over theirs


@dataclass(frozen=True, eq=False)
class Settings:
    """What is fixed before the process is fitted."""

    scale: float  # of the compressed pattern; 0: the pattern is the direction
    length: float  # mm
    noise: float  # variance of the noise over that of the process


@dataclass(frozen=True, eq=False)
class Templates:
    """The templates of a grid of places and how a pattern is compared with them."""

    scale: float  # as Settings
    places: Array  # (g, 2) mm
    pattern: Array  # (g, m) templates
    covariance: Array  # (m, m) R, shrunk
    temper: float

    @cached_property
    def factor(self) -> Array:
        """(m, m) lower Cholesky factor of R."""
        return np.asarray(np.linalg.cholesky(self.covariance), np.float64)

    @cached_property
    def whitened(self) -> Array:
        """(g, m) templates times the inverse factor."""
        return _whitened(self.factor, self.pattern)

    @cached_property
    def spacing(self) -> float:
        """Distance of neighbouring places of the grid, mm."""
        return float(np.diff(np.unique(self.places[:, 0])).max())

    @cached_property
    def size(self) -> Array:
        """(g,) squared norms of the whitened templates."""
        return np.sum(self.whitened**2, axis=1)

    def read(self, signal: Array) -> tuple[Array, Array, Array]:
        """Mean and standard deviation of the place, each (n, 2) in mm, of signals (n, m), and (n,) the squared distance
        of each from the nearest template."""
        misfit = self.misfit(signal)
        value, sd = _moments(self.places, misfit * self.temper)
        return value, np.hypot(sd, self.spacing / np.sqrt(12)), misfit.min(axis=1)

    def misfit(self, signal: Array) -> Array:
        """(n, g) squared distance of the patterns of signals (n, m) from each template, in the metric of R."""
        seen = _whitened(self.factor, _pattern(self.scale, signal))
        return np.maximum(np.sum(seen**2, axis=1)[:, None] + self.size - 2 * seen @ self.whitened.T, 0.0)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Templates, and what they read of rows that were held out."""

    templates: Templates
    place: Array  # (n, 2) mm
    sd: Array  # (n, 2) mm
    misfit: Array  # (n,) squared distance from the nearest template
    seen: tuple[tuple[Array, Array], ...]  # place and sd, as above, of the same presses as seen in other signals


def fit(signal: Array, place: Array, blocks: Index, *, compress: bool, seen: tuple[Array, ...] = ()) -> Fitted:
    """Templates of the compressed readings or of the direction of signals (n, m) at places (n, 2), mm; what they read
    of held-out rows, and of these as seen in other signals, (n, m) each."""
    last = slice(max(len(signal) - MOST_ROWS, 0), None)
    settings = _settings(signal[last], place[last], compress)
    grid = places_about(place[last])
    parts = [(kept := np.flatnonzero(blocks[last] != block), *_mapped(settings, signal[last][kept], place[last][kept],
              grid)) for block in np.unique(blocks[last])]
    tried = []
    for shrink in SHRINKS:
        misfit = np.empty((len(signal[last]), len(grid)))
        for kept, pattern, residual in parts:
            gone = np.setdiff1d(np.arange(len(misfit)), kept)
            one = Templates(settings.scale, grid, pattern, _shrunk(residual, shrink), 1.0)
            misfit[gone] = one.misfit(signal[last][gone])
        for temper in TEMPERS:
            value, _ = _moments(grid, misfit * temper)
            tried.append((float(np.linalg.norm(value - place[last], axis=1).mean()), shrink, -temper))
    _, shrink, temper = min(tried)
    pattern, residual = _mapped(settings, signal[last], place[last], grid)
    templates = Templates(settings.scale, grid, pattern, _shrunk(residual, shrink), -temper)
    without = [(np.setdiff1d(np.arange(last.start, len(signal)), last.start + kept),
                replace(templates, pattern=pattern, covariance=_shrunk(residual, shrink)))
               for kept, pattern, residual in parts]
    return Fitted(templates, *_held_out(templates, without, signal),
                  tuple(_held_out(templates, without, one)[:2] for one in seen))


def _held_out(templates: Templates, without: list[tuple[Index, Templates]],
              signal: Array) -> tuple[Array, Array, Array]:
    """What is read of signals (n, m), as Templates.read, of some rows by the templates that were made without them."""
    value, sd, nearest = templates.read(signal)
    for rows, part in without:
        value[rows], sd[rows], nearest[rows] = part.read(signal[rows])
    return value, sd, nearest


def places_about(place: Array) -> Array:
    """(g, 2) square grid of the disc about the middle of the range of places (n, 2)."""
    middle = (place.min(axis=0) + place.max(axis=0)) / 2
    radius = MARGIN * float(np.linalg.norm(place - middle, axis=1).max())
    axis = np.linspace(-radius, radius, ACROSS)
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    return middle + grid[np.linalg.norm(grid, axis=1) <= radius]


def _pattern(scale: float, signal: Array) -> Array:
    return compressed(signal, scale) if scale else direction(signal)


def _settings(signal: Array, place: Array, compress: bool) -> Settings:
    """Length and noise of the highest leave-one-out predictive density, one amplitude for all readings."""
    scale = compression_scale(signal) if compress else 0.0
    searched = spread_evenly(len(signal), MOST_SEARCHED)
    pattern, at = _pattern(scale, signal[searched]), place[searched]
    left, spread = pattern - pattern.mean(axis=0), float(np.sqrt(place.var(axis=0).mean()))
    scored = []
    for length in LENGTHS:
        values, axes = np.linalg.eigh(_kernel(at, at, length * spread))
        for noise in NOISES:
            inverse = 1 / (np.maximum(values, 0) + noise)
            variance = 1 / (axes**2 @ inverse)
            missed = axes @ (inverse[:, None] * (axes.T @ left)) * variance[:, None]
            common = np.mean(missed**2 / variance[:, None])
            scored.append((float(np.mean(np.log(common * variance))), length * spread, noise))
    return Settings(scale, *min(scored)[1:])


def _mapped(settings: Settings, signal: Array, place: Array, grid: Array) -> tuple[Array, Array]:
    """Templates (g, m) on the grid and leave-one-out residuals (n, m) of the rows."""
    pattern = _pattern(settings.scale, signal)
    mean = pattern.mean(axis=0)
    kernel = _kernel(place, place, settings.length) + settings.noise * np.eye(len(place))
    inverse = cho_solve(cho_factor(kernel), np.eye(len(place)))
    weights = inverse @ (pattern - mean)
    return mean + _kernel(grid, place, settings.length) @ weights, weights / np.diag(inverse)[:, None]


def _kernel(a: Array, b: Array, length: float) -> Array:
    root = np.sqrt(5 * squared_distance(a, b)) / length
    return (1 + root + root**2 / 3) * np.exp(-root)


def _shrunk(residual: Array, shrink: float) -> Array:
    covariance = residual.T @ residual / len(residual)
    mean = np.trace(covariance) / len(covariance)
    return (1 - shrink) * covariance + shrink * max(mean, np.finfo(float).tiny) * np.eye(len(covariance))


def _whitened(factor: Array, pattern: Array) -> Array:
    return solve_triangular(factor, pattern.T, lower=True).T


def _moments(places: Array, misfit: Array) -> tuple[Array, Array]:
    weight = np.exp(-0.5 * (misfit - misfit.min(axis=1, keepdims=True)))
    weight /= weight.sum(axis=1, keepdims=True)
    middle = places.mean(axis=0)
    mean = weight @ (places - middle)
    variance = weight @ (places - middle) ** 2 - mean**2
    return mean + middle, np.sqrt(np.maximum(variance, 0.0))
