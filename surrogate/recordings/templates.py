"""The map from place to pattern, read by its likelihood: a Gaussian process gives the pattern of a press at each place
of a grid, and a new pattern is read by the places whose templates explain it.

Patterns of n presses at places p_i follow the process of `pattern_process`, their noise of covariance R over the
readings. R comes from leave-one-out residuals, which hold the noise and the error of the map; it is shrunk towards its
diagonal as if that were PRIOR_PRESSES presses, and the log likelihood is tempered, since residuals are not quite
normal. Both numbers served other skins; none is chosen on the presses at hand, for which few of them are too few.
Templates are the mean over what may be expected of patterns, nothing or what physics says, weighted by the predictive
density of held-out blocks. Places are read no finer than the grid, an eightieth of the disc of the training places,
whose spacing the standard deviation includes.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from surrogate.recordings.disc_grid import disc_grid
from surrogate.recordings.pattern_process import MOST_SEARCHED, Expected, Process, choose, mapped
from surrogate.recordings.patterns import View, view_of
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Index

PRIOR_PRESSES = 80  # presses that the diagonal of R is worth
TEMPER = 0.3  # factor of the log likelihood
MOST_ROWS = 2000  # rows that are kept, the latest
ACROSS, MARGIN = 80, 1.05  # points of the grid across the disc about the places, and its radius over theirs
ALONG, MOST_ALONG = 0.99, 30  # part of the variance of templates that the directions of touches hold, and most of them
SMALLEST = 1e-6  # of the mean variance: no reading is taken as surer
LEAST = 0.03  # a smaller weight of what is expected is none: it costs time and changes nothing
PRIOR_FOLDS = 5  # runs of blocks that what is expected is learnt without, each in turn

# What is expected of patterns, compressed as they are, learnt from patterns (n, m) at places (n, 2), mm.
Prior = Callable[[Array, Array], Expected]


def nothing(pattern: Array, _: Array) -> Expected:
    """The prior that expects no pattern more than another."""
    return Expected(lambda place: np.zeros((len(place), pattern.shape[1])))


@dataclass(frozen=True, eq=False)
class Part:
    """What a prior expects without a run of blocks."""

    blocks: Index  # of the run
    rows: Array  # (n, m) at the places of all rows
    at: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Templates:
    """The templates of a grid of places and how a pattern is compared with them."""

    view: View
    places: Array  # (g, 2) mm
    pattern: Array  # (g, m) templates
    covariance: Array  # (m, m) R, shrunk
    weights: Array  # (priors,) of what is expected

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
        value, sd = _moments(self.places, misfit * TEMPER)
        left = (seen - self.whitened[misfit.argmin(axis=1)]) @ self.touching
        return (value, np.hypot(sd, self.spacing / np.sqrt(12)),
                np.stack([misfit.min(axis=1), np.sum(left**2, axis=1)], axis=1))

    def seen(self, signal: Array) -> Array:
        """(n, m) patterns of signals (n, m), whitened."""
        return _whitened(self.factor, self.view.of(signal))

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
    of held-out rows, and of these as seen in other signals, (n, m) each. press: (n,) of each row, which no block
    splits; each row is its own where that is None."""
    last = slice(max(len(signal) - MOST_ROWS, 0), None)
    view = view_of(signal[last], compress)
    pattern, at, grid = view.of(signal[last]), place[last], places_about(place[last])
    own = np.arange(len(pattern)) if press is None else press[last]
    learnt = [prior(pattern, at) for prior in priors]
    processes = [choose(pattern, at, one.of(at), own) for one in learnt]
    parts = [_parts(pattern, at, blocks[last], prior) for prior in priors]
    weights = _weights(pattern, at, blocks[last], parts, processes, own)
    used = np.flatnonzero(weights)
    shrink = PRIOR_PRESSES / (PRIOR_PRESSES + len(np.unique(own)))

    def templates(each: Iterable[tuple[Array, Array]]) -> Templates:
        mean, residual = (np.tensordot(weights[used], np.stack(found), 1) for found in zip(*each, strict=True))
        return Templates(view, grid, mean, _shrunk(residual, shrink), weights)

    whole = templates(mapped(processes[i], pattern, at, learnt[i].of(at), grid, learnt[i].at(grid), own) for i in used)
    without = []
    for run in zip(*(parts[i] for i in used), strict=True):
        on_grid = [part.at(grid) for part in run]
        for block in run[0].blocks:
            kept = blocks[last] != block
            without.append((last.start + np.flatnonzero(~kept), templates(
                mapped(processes[i], pattern[kept], at[kept], part.rows[kept], grid, there, own[kept])
                for i, part, there in zip(used, run, on_grid, strict=True))))
    return Fitted(whole, *_held_out(whole, without, signal), tuple(_held_out(whole, without, one)[:2] for one in seen))


def _held_out(templates: Templates, without: list[tuple[Index, Templates]],
              signal: Array) -> tuple[Array, Array, Array]:
    """What is read of signals (n, m), as Templates.read, of some rows by the templates that were made without them."""
    value, sd, nearest = templates.read(signal)
    for rows, part in without:
        value[rows], sd[rows], nearest[rows] = part.read(signal[rows])
    return value, sd, nearest


def _weights(pattern: Array, place: Array, blocks: Index, parts: Sequence[Sequence[Part]],
             processes: Sequence[Process], press: Index) -> Array:
    """(priors,) weights by the predictive density of the patterns of held-out blocks: the mean square that a prior's
    process misses of them, to the power of minus half the presses, as if all readings were one."""
    if len(parts) == 1:
        return np.ones(1)
    rows = spread_evenly(len(pattern), MOST_SEARCHED)
    pattern, place, blocks, press = pattern[rows], place[rows], blocks[rows], press[rows]

    def missed(process: Process, part: Part, block: int) -> float:
        kept, expected = blocks != block, part.rows[rows]
        found, _ = mapped(process, pattern[kept], place[kept], expected[kept], place[~kept], expected[~kept])
        return float(np.sum((found - pattern[~kept]) ** 2))

    total = np.array([sum(missed(process, part, block) for part in each for block in part.blocks)
                      for process, each in zip(processes, parts, strict=True)])
    weights = (total.min() / np.maximum(total, np.finfo(float).tiny)) ** (len(np.unique(press)) / 2)
    weights = np.where(weights < LEAST * weights.sum(), 0.0, weights)
    return weights / weights.sum()


def _parts(pattern: Array, place: Array, blocks: Index, prior: Prior) -> list[Part]:
    """What is expected by rows outside each run of blocks."""
    names, out = np.unique(blocks), []
    for run in np.array_split(names, min(PRIOR_FOLDS, len(names))):
        outside = ~np.isin(blocks, run)
        learnt = prior(pattern[outside], place[outside])
        rows = learnt.at(place)
        rows[outside] = learnt.of(place[outside])
        out.append(Part(run, rows, learnt.at))
    return out


def places_about(place: Array) -> Array:
    """(g, 2) square grid of the disc about the middle of the range of places (n, 2)."""
    middle = (place.min(axis=0) + place.max(axis=0)) / 2
    radius = MARGIN * float(np.linalg.norm(place - middle, axis=1).max())
    return disc_grid(middle, radius, ACROSS)


def _shrunk(residual: Array, shrink: float) -> Array:
    covariance = residual.T @ residual / len(residual)
    variance = np.diag(covariance)
    least = max(SMALLEST * float(variance.mean()), np.finfo(float).tiny)
    return (1 - shrink) * covariance + np.diag(shrink * variance + least)


def _whitened(factor: Array, pattern: Array) -> Array:
    return solve_triangular(factor, pattern.T, lower=True).T


def _moments(places: Array, misfit: Array) -> tuple[Array, Array]:
    weight = np.exp(-0.5 * (misfit - misfit.min(axis=1, keepdims=True)))
    weight /= weight.sum(axis=1, keepdims=True)
    middle = places.mean(axis=0)
    mean = weight @ (places - middle)
    variance = weight @ (places - middle) ** 2 - mean**2
    return mean + middle, np.sqrt(np.maximum(variance, 0.0))
