"""How a skin was moved on the table between two sessions: a turn and a shift of all places.

Labelled presses err about a motion as Student's t says, of a scale that may be several times the first session's. A
motion is compared with none by its mean likelihood over all turns and over shifts evenly drawn from a disc (Bayes
factor); its estimate is the mean of its posterior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from surrogate.recordings.disc_grid import disc_grid
from surrogate.statistics.conformal import COVERAGE, Bounds, normal
from touchcal.arrays import Array

TURNS, ACROSS = 72, 21  # turns tried, and shifts across a disc about the one that fits best
REACH, FARTHEST = 0.5, 2.0  # radius of that disc, and of that of shifts before any press, over that of the places
ROUNDS, FINER = 3, 0.35  # of finer searches about the best, each over so much of the last one's spacings
MOVED = 0.2  # probability that a skin was moved, before any press
FREEDOM = 4.0  # of the errors of presses
SCALES = (1.0, 1.5, 2.0, 3.0, 4.0)  # of errors in the second session over the first


@dataclass(frozen=True, eq=False)
class Motion:
    """Places p go to middle + R(turn) (p - middle) + shift."""

    middle: Array  # (2,) mm
    turn: float  # rad
    shift: Array  # (2,) mm
    turn_sd: float = 0.0  # rad
    shift_sd: float = 0.0  # mm, along an axis

    @property
    def matrix(self) -> Array:
        """(2, 2) R."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.array([[c, -s], [s, c]])

    def of(self, place: Array) -> Array:
        """(n, 2) where places (n, 2) of the first session, mm, lie in the second."""
        return self.middle + (place - self.middle) @ self.matrix.T + self.shift

    def back(self, place: Array) -> Array:
        """(n, 2) the inverse of `of`."""
        return self.middle + (place - self.middle - self.shift) @ self.matrix

    def bounds(self, place: Array, bounds: Bounds) -> Bounds:
        """Bounds of places (n, 2) of the first session, in the coordinates of the second."""
        half, turned = bounds.half_width, self.matrix
        across = bounds.correlation * half.prod(axis=1)
        covariance = turned @ np.stack([np.stack([half[:, 0] ** 2, across], axis=1),
                                        np.stack([across, half[:, 1] ** 2], axis=1)], axis=1) @ turned.T
        unsure = self.shift_sd**2 + self.turn_sd**2 * np.sum((place - self.middle) ** 2, axis=1)
        covariance += normal(COVERAGE) ** 2 * unsure[:, None, None] * np.eye(2)
        wide = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        return replace(bounds, half_width=wide, correlation=covariance[:, 0, 1] / wide.prod(axis=1))


def find_motion(read: Array, labelled: Array, radius: float, error: float) -> tuple[Motion | None, float]:
    """The mean motion, None where a skin that lies still is likelier, and the logarithm of its likelihood: of presses
    read at (k, 2) and labelled at (k, 2), where the first session's places lie within a radius and are read to a root
    mean square error along an axis, mm."""
    middle = read.mean(axis=0)
    still = float(_likelihood(read - labelled, error))
    tried, shifts = 2 * np.pi * np.arange(TURNS) / TURNS, disc_grid(np.zeros(2), REACH * radius, ACROSS)
    around, apart = 2 * np.pi / TURNS, 2 * REACH * radius / (ACROSS - 1)
    scores = _scores(middle, tried, shifts, read, labelled, error)
    moved = float(np.asarray(logsumexp(scores))) - np.log(scores.size) + 2 * np.log(REACH / FARTHEST)
    if moved + np.log(MOVED) <= still + np.log1p(-MOVED):
        return None, still
    best, at = np.unravel_index(scores.argmax(), scores.shape)
    turn, off = float(tried[best]), shifts[at]
    for _ in range(ROUNDS):
        turns, near = turn + around * np.linspace(-1, 1, 9), off + disc_grid(np.zeros(2), 1.5 * apart, 9)
        score = _scores(middle, turns, near, read, labelled, error)
        weight = np.exp(score - logsumexp(score))
        turn, off = float(np.sum(weight * turns[:, None])), np.einsum("tg,gk->k", weight, near)
        around, apart = FINER * around, FINER * apart
    found = Motion(middle, turn, _fitting(middle, turn, read, labelled) + off)
    variance = max(float(np.sum((found.of(read) - labelled) ** 2)) / (2 * len(read) - 3), error**2)
    turn_sd = np.sqrt(variance / np.sum((read - middle) ** 2))
    return replace(found, turn_sd=float(turn_sd), shift_sd=float(np.sqrt(variance / len(read)))), moved


def _scores(middle: Array, turns: Array, shifts: Array, read: Array, labelled: Array,
            error: float) -> Array:
    """(t, s) log likelihoods of turns (t,) and of shifts (s, 2) off those that fit best."""
    left = np.stack([Motion(middle, turn, _fitting(middle, turn, read, labelled)).of(read) - labelled
                     for turn in turns])
    return _likelihood(left[:, None] + shifts[:, None], error)


def _fitting(middle: Array, turn: float, read: Array, labelled: Array) -> Array:
    """(2,) the shift after a turn that fits places as read to labels by least squares."""
    return np.mean(labelled - Motion(middle, turn, np.zeros(2)).of(read), axis=0)


def _likelihood(left: Array, error: float) -> Array:
    """(...,) log likelihood of errors (..., k, 2), in the mean over their scales, those of the first session."""
    square = np.sum(left**2, axis=-1)
    each = [np.sum(-(FREEDOM + 2) / 2 * np.log1p(square / FREEDOM / (scale * error) ** 2)
                   - 2 * np.log(scale * error), axis=-1) for scale in SCALES]
    return np.asarray(logsumexp(each, axis=0))
