"""The map from place to pattern, read by its likelihood: a Gaussian process gives the pattern of a press at each place
of a grid, and a new pattern is read by the places whose templates explain it.

Patterns of n presses at places p_i follow the process of `pattern_process`, their noise of covariance R over the
readings. R comes from leave-one-out residuals, which hold the noise and the error of the map; it is shrunk towards a
multiple of the unit matrix, and the log likelihood is tempered, since residuals are not quite normal: both are chosen
by reading held-out blocks. Whether the process goes on from what physics expects is chosen by the patterns of held-out
blocks, which say so more surely than places do. Places are read no finer than the grid, an eightieth of the disc of the
training places, whose spacing the standard deviation includes.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from surrogate.recordings.disc_grid import disc_grid
from surrogate.recordings.pattern_process import MOST_SEARCHED, choose, mapped
from surrogate.recordings.patterns import compressed, compression_scale, direction
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Index

SHRINKS = (0.02, 0.1, 0.3, 0.9)  # parts of R that are a multiple of the unit matrix
TEMPERS = (1.0, 0.3, 0.1, 0.03)  # factors of the log likelihood
MOST_ROWS = 2000  # rows that are kept, the latest
ACROSS, MARGIN = 80, 1.05  # points of the grid across the disc about the places, and its radius over theirs
ALONG, MOST_ALONG = 0.99, 30  # part of the variance of templates that the directions of touches hold, and most of them
WORTH = 0.95  # part of what the first prior misses: another one that misses more is not worth its gains
PRIOR_FOLDS = 5  # runs of blocks that what is expected is learnt without, each in turn

# What is expected of patterns, learnt from patterns (n, m) at places (n, 2), mm: a function from places (g, 2) to
# patterns (g, m), known up to a gain of each reading.
Prior = Callable[[Array, Array], Callable[[Array], Array]]


def nothing(pattern: Array, _: Array) -> Callable[[Array], Array]:
    """The prior that expects no pattern more than another."""
    return lambda place: np.zeros((len(place), pattern.shape[1]))


@dataclass(frozen=True, eq=False)
class Templates:
    """The templates of a grid of places and how a pattern is compared with them."""

    scale: float  # of the compressed pattern; 0: the pattern is the direction
    places: Array  # (g, 2) mm
    pattern: Array  # (g, m) templates
    covariance: Array  # (m, m) R, shrunk
    temper: float
    prior: int  # number of the prior that they go on from

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

    @cached_property
    def touching(self) -> Array:
        """(m, k) orthonormal directions in which whitened templates differ: what lies along them moves the place."""
        centred = self.whitened - self.whitened.mean(axis=0)
        variance, axes = np.linalg.eigh(centred.T @ centred)
        held = np.cumsum(variance[::-1]) / max(variance.sum(), np.finfo(float).tiny)
        return axes[:, ::-1][:, :min(int(np.searchsorted(held, ALONG)) + 1, MOST_ALONG)]

    def read(self, signal: Array) -> tuple[Array, Array, Array]:
        """Mean and standard deviation of the place, each (n, 2) in mm, of signals (n, m), and (n, 2) the squared
        distance of each from the nearest template, in all and along the directions of touches."""
        seen = self.seen(signal)
        misfit = self.misfit(seen)
        value, sd = _moments(self.places, misfit * self.temper)
        left = (seen - self.whitened[misfit.argmin(axis=1)]) @ self.touching
        return (value, np.hypot(sd, self.spacing / np.sqrt(12)),
                np.stack([misfit.min(axis=1), np.sum(left**2, axis=1)], axis=1))

    def seen(self, signal: Array) -> Array:
        """(n, m) patterns of signals (n, m), whitened."""
        return _whitened(self.factor, _pattern(self.scale, signal))

    def misfit(self, seen: Array) -> Array:
        """(n, g) squared distance of whitened patterns (n, m) from each template."""
        return np.maximum(np.sum(seen**2, axis=1)[:, None] + self.size - 2 * seen @ self.whitened.T, 0.0)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Templates, and what they read of rows that were held out."""

    templates: Templates
    place: Array  # (n, 2) mm
    sd: Array  # (n, 2) mm
    misfit: Array  # (n, 2) squared distance from the nearest template, in all and along the directions of touches
    seen: tuple[tuple[Array, Array], ...]  # place and sd, as above, of the same presses as seen in other signals


def fit(signal: Array, place: Array, blocks: Index, *, compress: bool, seen: tuple[Array, ...] = (),
        priors: Sequence[Prior] = (nothing,), press: Index | None = None) -> Fitted:
    """Templates of the compressed readings or of the direction of signals (n, m) at places (n, 2), mm; what they read
    of held-out rows, and of these as seen in other signals, (n, m) each. They go on from the first prior unless another
    leaves less than WORTH times as much of the patterns of held-out blocks. press: (n,) of each row, which no block
    splits; each row is its own where that is None."""
    last = slice(max(len(signal) - MOST_ROWS, 0), None)
    scale = compression_scale(signal[last]) if compress else 0.0
    pattern, at, grid = _pattern(scale, signal[last]), place[last], places_about(place[last])
    own = np.arange(len(pattern)) if press is None else press[last]
    number = 0 if len(priors) == 1 else _chosen(pattern, at, blocks[last], priors, own)
    learnt = priors[number](pattern, at)
    process = choose(pattern, at, learnt(at), own)
    parts = [(block, *mapped(process, pattern[kept], at[kept], part(at[kept]), grid, part(grid), own[kept]))
             for kept, block, part in _parts(pattern, at, blocks[last], priors[number])]
    tried = []
    for shrink in SHRINKS:
        misfit = np.empty((len(pattern), len(grid)))
        for gone, mean, residual in parts:
            part = Templates(scale, grid, mean, _shrunk(residual, shrink), 1.0, number)
            misfit[gone] = part.misfit(part.seen(signal[last][gone]))
        for temper in TEMPERS:
            value, _ = _moments(grid, misfit * temper)
            tried.append((float(np.linalg.norm(value - at, axis=1).mean()), shrink, -temper))
    _, shrink, temper = min(tried)
    mean, residual = mapped(process, pattern, at, learnt(at), grid, learnt(grid), own)
    templates = Templates(scale, grid, mean, _shrunk(residual, shrink), -temper, number)
    without = [(last.start + block, replace(templates, pattern=mean, covariance=_shrunk(residual, shrink)))
               for block, mean, residual in parts]
    return Fitted(templates, *_held_out(templates, without, signal),
                  tuple(_held_out(templates, without, one)[:2] for one in seen))


def _held_out(templates: Templates, without: list[tuple[Index, Templates]],
              signal: Array) -> tuple[Array, Array, Array]:
    """What is read of signals (n, m), as Templates.read, of some rows by the templates that were made without them."""
    value, sd, nearest = templates.read(signal)
    for rows, part in without:
        value[rows], sd[rows], nearest[rows] = part.read(signal[rows])
    return value, sd, nearest


def _chosen(pattern: Array, place: Array, blocks: Index, priors: Sequence[Prior], press: Index) -> int:
    """Number of the prior whose processes miss the patterns of held-out blocks least, in the mean square, the first
    one's square counted WORTH times."""
    rows = spread_evenly(len(pattern), MOST_SEARCHED)
    pattern, place, blocks, press = pattern[rows], place[rows], blocks[rows], press[rows]
    missed = []
    for prior in priors:
        process = choose(pattern, place, prior(pattern, place)(place), press)
        missed.append(sum(float(np.sum((mapped(process, pattern[kept], place[kept], part(place[kept]), place[block],
                                               part(place[block]))[0] - pattern[block])**2))
                          for kept, block, part in _parts(pattern, place, blocks, prior)))
    return int(np.argmin([WORTH * missed[0], *missed[1:]]))


def _parts(pattern: Array, place: Array, blocks: Index,
           prior: Prior) -> Iterator[tuple[Index, Index, Callable[[Array], Array]]]:
    """For each block the rows outside it, its rows, and what is expected by rows outside a run of blocks about it."""
    names = np.unique(blocks)
    for run in np.array_split(names, min(PRIOR_FOLDS, len(names))):
        outside = ~np.isin(blocks, run)
        learnt = prior(pattern[outside], place[outside])
        for block in run:
            yield np.flatnonzero(blocks != block), np.flatnonzero(blocks == block), learnt


def places_about(place: Array) -> Array:
    """(g, 2) square grid of the disc about the middle of the range of places (n, 2)."""
    middle = (place.min(axis=0) + place.max(axis=0)) / 2
    radius = MARGIN * float(np.linalg.norm(place - middle, axis=1).max())
    return disc_grid(middle, radius, ACROSS)


def _pattern(scale: float, signal: Array) -> Array:
    return compressed(signal, scale) if scale else direction(signal)


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
