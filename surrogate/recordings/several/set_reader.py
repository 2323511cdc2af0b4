"""Which places are pressed, of all sets of places: the posterior of each set under superposition.

A signal is a touched frame less the untouched one tracked to its time, less what touched frames share in their
neighbourhood: that offset is found together with the sets, by turns. Likelihoods of sets are Student's, which holds
what is not known of patterns and noise; they are tempered so that held-out presses are as likely as stated.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp
from scipy.stats import f as fisher

from surrogate.recordings.baselines import interpolated
from surrogate.recordings.presses import Presses, taken
from surrogate.recordings.several.rest_track import offset_track, rest_width, tracked, weights
from surrogate.recordings.several.superposition import Superposition, design_of, learn
from touchcal.arrays import Array, Index, Mask

MOST_PLACES = 10  # 1,023 sets
TURNS = 4  # of sets and offset
BLOCKS = 4  # in time, of which each is held out
TEMPERS = (0.05, 1.5)  # range of the exponent of likelihoods
ODD = 0.01  # part of held-out presses whose misfit is called odd


@dataclass(frozen=True, eq=False)
class SetReader:
    """What reads which of k places are pressed."""

    superposition: Superposition
    rest_width: float  # of the track of untouched frames, in the unit of `Presses.time`
    offset_width: float  # of the offset of touched frames, likewise; 0: none
    offset_pull: float
    used: Mask  # (channels,) readings that are not dead in training
    temper: float  # exponent of likelihoods
    odd: float  # squared whitened misfit a reading above which a signal is unlike any set

    @property
    def places(self) -> int:
        """Number of places."""
        return len(self.superposition.pattern) - len(self.superposition.pairs)

    @property
    def sets(self) -> Mask:
        """(2^k - 1, k) all sets of one place or more."""
        return np.array([*product((False, True), repeat=self.places)])[1:]


@dataclass(frozen=True, eq=False)
class SetReading:
    """What is read of some frames."""

    sets: Mask  # (s, k)
    probability: Array  # (n, s) of each set
    misfit: Array  # (n,) squared whitened misfit a reading of the likeliest set

    @property
    def down(self) -> Mask:
        """(n, k) the likeliest set."""
        return self.sets[self.probability.argmax(axis=1)]

    @property
    def place(self) -> Array:
        """(n, k) probability that each place is pressed."""
        return self.probability @ self.sets

    @property
    def count(self) -> Array:
        """(n, k) probability of one, two ... k touches."""
        return self.probability @ (self.sets.sum(axis=1)[:, None] == np.arange(1, self.sets.shape[1] + 1))


def fit(presses: Presses, down: Mask, press: Index) -> tuple[SetReader, SetReading]:
    """Learn the patterns of places (n, k) that frames press, and what readers without a block in time read of it.
    press: (n,) number of the press that each frame shows, which no block splits."""
    reader = _learnt(presses, down)
    blocks = np.array_split(np.unique(press), BLOCKS)
    score, misfit = np.empty((len(down), len(reader.sets))), np.empty(len(down))
    for block in blocks:
        gone = np.isin(press, block)
        part = _learnt(taken(presses, np.flatnonzero(~gone)), down[~gone], reader.used)
        score[gone], misfit[gone] = _scores(part, taken(presses, np.flatnonzero(gone)))
    truth = set_numbers(down)
    temper = _temper(score, truth)
    readings, freedom = int(reader.used.sum()), reader.superposition.freedom
    odd = max(float(np.quantile(misfit, 1 - ODD)), float(fisher.ppf(1 - ODD / 10, readings, freedom)))
    reader = _tempered(reader, temper, odd)
    return reader, SetReading(reader.sets, np.exp(_log_posterior(score * temper)), misfit)


def read(reader: SetReader, presses: Presses) -> SetReading:
    """The probability of each set of places in each frame; dead readings are left out of the likelihood."""
    score, misfit = _scores(reader, presses)
    return SetReading(reader.sets, np.exp(_log_posterior(score * reader.temper)), misfit)


def set_numbers(down: Mask) -> Index:
    """(n,) number of each set (n, k) among `SetReader.sets`."""
    return (down @ (1 << np.arange(down.shape[1])[::-1]) - 1).astype(np.intp)


def _temper(score: Array, truth: Index) -> float:
    """The exponent of likelihoods, given by their logarithms (n, s), that makes the true sets (n,) likeliest."""
    at, rows = np.geomspace(*TEMPERS, 100), np.arange(len(truth))
    return float(at[np.argmax([_log_posterior(score * one)[rows, truth].sum() for one in at])])


def _tempered(reader: SetReader, temper: float, odd: float) -> SetReader:
    return SetReader(reader.superposition, reader.rest_width, reader.offset_width, reader.offset_pull, reader.used,
                     temper, odd)


def _learnt(presses: Presses, down: Mask, used: Mask | None = None) -> SetReader:
    """A reader of likelihoods that are not tempered."""
    used = np.asarray(np.isfinite(presses.signal).all(axis=0) if used is None else used, bool)
    rest = presses.rest[:, used]
    sound = np.isfinite(rest).all(axis=1)
    width, untouched = 0.0, None
    if sound.sum() > 2:
        width, error = rest_width(rest[sound], presses.rest_time[sound])
        untouched = _shrunk(error)
    amount = down.astype(float)
    signal = _signal(presses, width)[:, used]
    offset = np.zeros_like(signal)
    for _ in range(TURNS):
        learnt = learn(amount, signal - offset, untouched)
        factor = _cholesky(learnt.covariance)
        residual = _whitened(factor, signal - learnt.means(design_of(amount, learnt.pairs)))
        span, pull, white = offset_track(residual, presses.time)
        offset = white @ factor.T
    return SetReader(learnt, width, span, pull, used, 1.0, np.inf)


def _signal(presses: Presses, width: float) -> Array:
    """(n, m) touched frames less the untouched one tracked by a width; as they are where it is 0."""
    if not width or len(presses.rest) < 2:
        return presses.signal
    sound = np.isfinite(presses.rest).all(axis=1)
    nearest, _ = interpolated(presses.rest, presses.rest_time, presses.time)
    track = tracked(weights(presses.time, presses.rest_time[sound], width), presses.rest[sound])
    return presses.signal + nearest - track


def _scores(reader: SetReader, presses: Presses) -> tuple[Array, Array]:
    """Log likelihoods (n, s) of the sets but for a constant a frame, and the misfit (n,) of the likeliest set."""
    signal = _signal(presses, reader.rest_width)[:, reader.used]
    learnt, span = reader.superposition, reader.offset_width
    means = learnt.means(design_of(reader.sets.astype(float), learnt.pairs))
    around = weights(presses.time, presses.time, span) if span else None
    offset = np.zeros_like(signal)
    score, misfit = _likelihoods(reader, means, signal)
    for _ in range(TURNS if span else 0):
        residual = signal - np.exp(_log_posterior(score * reader.temper)) @ means
        assert around is not None
        offset = tracked(around, np.nan_to_num(residual), reader.offset_pull)
        score, misfit = _likelihoods(reader, means, signal - offset)
    return score, misfit


def _likelihoods(reader: SetReader, means: Array, signal: Array) -> tuple[Array, Array]:
    """Log likelihoods (n, s) and the misfit (n,) of signals (n, m), frames of the same dead readings together."""
    learnt = reader.superposition
    wider = 1 + learnt.uncertain(design_of(reader.sets.astype(float), learnt.pairs))
    score, misfit = np.empty((len(signal), len(means))), np.empty(len(signal))
    kinds, kind = np.unique(np.isfinite(signal), axis=0, return_inverse=True)
    for number, live in enumerate(kinds):
        rows, count = kind.ravel() == number, int(live.sum())
        factor = _cholesky(learnt.covariance[np.ix_(live, live)])
        seen, expected = _whitened(factor, signal[rows][:, live]), _whitened(factor, means[:, live])
        square = np.sum(seen**2, axis=1)[:, None] + np.sum(expected**2, axis=1) - 2 * seen @ expected.T
        square = np.maximum(square, 0.0) / wider
        score[rows] = -(count * np.log(wider) + (learnt.freedom + count) * np.log1p(square / learnt.freedom)) / 2
        misfit[rows] = square[np.arange(len(seen)), score[rows].argmax(axis=1)] / max(count, 1)
    return score, misfit


def _log_posterior(score: Array) -> Array:
    """(n, s) logarithms of posteriors, all sets being as likely before."""
    return score - logsumexp(score, axis=1, keepdims=True)


def _cholesky(covariance: Array) -> Array:
    return np.asarray(np.linalg.cholesky(covariance), np.float64)


def _whitened(factor: Array, signal: Array) -> Array:
    return solve_triangular(factor, signal.T, lower=True).T


def _shrunk(error: Array) -> Array:
    """(m, m) covariance of errors (k, m), drawn to the same noise in all readings, the more the fewer there are."""
    count, readings = error.shape
    share = readings / (readings + count)
    covariance = error.T @ error / count
    return (1 - share) * covariance + share * max(np.trace(covariance) / readings, np.finfo(float).tiny) * np.eye(
        readings)
