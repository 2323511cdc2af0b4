"""Which places are pressed, of all sets of places: the posterior of each set under superposition.

A signal is the mean of the touched frames of a press less the untouched frame tracked to its time, less what presses
share in their neighbourhood: that offset is found together with the sets, by turns. Likelihoods of sets are Student's,
which holds what is not known of patterns and noise; they are tempered so that held-out presses are as likely as stated.
Where presses differ in force, amounts over the mean one of a place are normal about 1 as in training, and marginal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp
from scipy.stats import f as fisher

from surrogate.recordings.baselines import interpolated
from surrogate.recordings.presses import Presses, taken
from surrogate.recordings.several.press_means import FrameNoise, counts, frame_noise, means
from surrogate.recordings.several.rest_track import offset_track, rest_width, tracked, weights
from surrogate.recordings.several.superposition import Superposition, design_of, learn, shrunk
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
    loose: Array  # (k,) standard deviation of the amount of each place over its mean; 0 where amounts are not known
    widening: float  # half width of the 90 % interval of an amount over its standard deviation
    frames: FrameNoise | None = None  # None: whether frames of a press differ is unknown, and more of them say no more

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
    """What is read of some presses."""

    sets: Mask  # (s, k)
    probability: Array  # (n, s) of each set
    misfit: Array  # (n,) squared whitened misfit a reading of the likeliest set
    amount: Array  # (n, k) amount of each place over its mean in the likeliest set, 0 where it is not pressed
    half_width: Array  # (n, k) half width of its 90 % interval

    def some(self, rows: Index) -> SetReading:
        """What is read of some of the presses."""
        return SetReading(self.sets, self.probability[rows], self.misfit[rows], self.amount[rows],
                          self.half_width[rows])

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


def fit(presses: Presses, amount: Array, press: Index) -> tuple[SetReader, SetReading]:
    """Learn the patterns of places from how much presses press each (p, k), over the mean of the place, and what
    readers without a block in time read of them. press: (n,) number of the press that each frame shows."""
    reader, down = _learnt(presses, amount, press), amount > 0
    numbers = np.unique(press)
    score, misfit = np.empty((len(down), len(reader.sets))), np.empty(len(down))
    found, sd = np.zeros_like(amount), np.zeros_like(amount)
    truth = set_numbers(down)
    for block in np.array_split(numbers, BLOCKS):
        gone, frames = np.isin(numbers, block), np.isin(press, block)
        kept, out = np.flatnonzero(~frames), np.flatnonzero(frames)
        part = _learnt(taken(presses, kept), amount[~gone], press[kept], reader.used)
        score[gone], misfit[gone], seen = _scores(part, taken(presses, out), press[out])
        found[gone], sd[gone] = _amounts(part, seen, truth[gone])
    temper = _temper(score, truth)
    readings, freedom = int(reader.used.sum()), reader.superposition.freedom
    odd = max(float(np.quantile(misfit, 1 - ODD)), float(fisher.ppf(1 - ODD / 10, readings, freedom)))
    known = sd > 0
    widening = float(np.quantile(np.abs(found - amount)[known] / sd[known], 0.9)) if known.any() else 0.0
    return (replace(reader, temper=temper, odd=odd, widening=widening),
            SetReading(reader.sets, np.exp(_log_posterior(score * temper)), misfit, found, widening * sd))


def read(reader: SetReader, presses: Presses, press: Index) -> SetReading:
    """The probability of each set of places in each press (n,) that frames show; dead readings are left out of the
    likelihood."""
    score, misfit, seen = _scores(reader, presses, press)
    amount, sd = _amounts(reader, seen, score.argmax(axis=1))
    return SetReading(reader.sets, np.exp(_log_posterior(score * reader.temper)), misfit, amount, reader.widening * sd)


def set_numbers(down: Mask) -> Index:
    """(n,) number of each set (n, k) among `SetReader.sets`."""
    return (down @ (1 << np.arange(down.shape[1])[::-1]) - 1).astype(np.intp)


def _temper(score: Array, truth: Index) -> float:
    """The exponent of likelihoods, given by their logarithms (n, s), that makes the true sets (n,) likeliest."""
    at, rows = np.geomspace(*TEMPERS, 100), np.arange(len(truth))
    return float(at[np.argmax([_log_posterior(score * one)[rows, truth].sum() for one in at])])


@dataclass(frozen=True, eq=False)
class _Seen:
    """Means of the frames of presses."""

    signal: Array  # (p, m) less the offset; NaN where a reading is dead
    frames: Index  # (p,) frames


def _learnt(presses: Presses, amount: Array, press: Index, used: Mask | None = None) -> SetReader:
    """A reader of likelihoods that are not tempered."""
    used = np.asarray(np.isfinite(presses.signal).all(axis=0) if used is None else used, bool)
    rest = presses.rest[:, used]
    sound = np.isfinite(rest).all(axis=1)
    width, untouched = 0.0, None
    if sound.sum() > 2:
        width, error = rest_width(rest[sound], presses.rest_time[sound])
        untouched = shrunk(error) * len(amount) / len(press)
    each = _signal(presses, width)[:, used]
    signal, time = means(press, each), means(press, presses.time[:, None])[:, 0]
    offset = np.zeros_like(signal)
    for _ in range(TURNS):
        learnt = learn(amount, signal - offset, untouched)
        factor = _cholesky(learnt.covariance)
        residual = _whitened(factor, signal - learnt.means(design_of(amount, learnt.pairs)))
        span, pull, white = offset_track(residual, time)
        offset = white @ factor.T
    loose = np.sqrt(np.sum((amount - 1) ** 2 * (amount > 0), axis=0) / np.maximum(np.sum(amount > 0, axis=0), 1))
    return SetReader(learnt, width, span, pull, used, 1.0, np.inf, loose, 0.0, frame_noise(press, each, factor))


def _signal(presses: Presses, width: float) -> Array:
    """(n, m) touched frames less the untouched one tracked by a width, each reading by the untouched frames that have
    it; as they are where the width is 0."""
    if not width or len(presses.rest) < 2:
        return presses.signal
    nearest, _ = interpolated(presses.rest, presses.rest_time, presses.time)
    track = np.full_like(nearest, np.nan)
    kinds, kind = np.unique(np.isfinite(presses.rest), axis=1, return_inverse=True)
    for number, sound in enumerate(kinds.T):
        if sound.any():
            same = kind.ravel() == number
            track[:, same] = tracked(weights(presses.time, presses.rest_time[sound], width),
                                      presses.rest[np.ix_(sound, same)])
    return presses.signal + nearest - track


def _scores(reader: SetReader, presses: Presses, press: Index) -> tuple[Array, Array, _Seen]:
    """Log likelihoods (p, s) of the sets but for a constant a press, the misfit (p,) of the likeliest set, and what is
    seen."""
    each = _signal(presses, reader.rest_width)[:, reader.used]
    seen, time = _Seen(means(press, each), counts(press, each)), means(press, presses.time[:, None])[:, 0]
    learnt, span = reader.superposition, reader.offset_width
    expected = learnt.means(design_of(reader.sets.astype(float), learnt.pairs))
    around = weights(time, time, span) if span else None
    found = seen
    score, misfit = _likelihoods(reader, expected, seen)
    for _ in range(TURNS if span else 0):
        residual = seen.signal - np.exp(_log_posterior(score * reader.temper)) @ expected
        assert around is not None
        offset = tracked(around, np.nan_to_num(residual), reader.offset_pull)
        found = replace(seen, signal=seen.signal - offset)
        score, misfit = _likelihoods(reader, expected, found)
    return score, misfit, found


def _likelihoods(reader: SetReader, means: Array, seen: _Seen) -> tuple[Array, Array]:
    """Log likelihoods (p, s) and the misfit (p,) of presses, those of the same dead readings and as many frames
    together."""
    learnt, signal = reader.superposition, seen.signal
    uncertain = learnt.uncertain(design_of(reader.sets.astype(float), learnt.pairs))
    score, misfit = np.empty((len(signal), len(means))), np.empty(len(signal))
    kinds, kind = np.unique(np.column_stack([seen.frames, np.isfinite(signal)]), axis=0, return_inverse=True)
    for number, (frames, *finite) in enumerate(kinds.tolist()):
        live = np.array(finite, bool)
        rows, count = kind.ravel() == number, int(live.sum())
        factor, size = _factor(reader, frames, live)
        wider = 1 + uncertain / size
        white, expected = _whitened(factor, signal[rows][:, live]), _whitened(factor, means[:, live])
        square = np.sum(white**2, axis=1)[:, None] + np.sum(expected**2, axis=1) - 2 * white @ expected.T
        volume = count * np.log(wider)
        if reader.loose.any():
            less, more = _loosened(reader, white, expected, live, factor)
            square, volume = square - less, volume + more
        square = np.maximum(square, 0.0) / wider
        score[rows] = -(volume + (learnt.freedom + count) * np.log1p(square / learnt.freedom)) / 2
        misfit[rows] = square[np.arange(len(white)), score[rows].argmax(axis=1)] / max(count, 1)
    return score, misfit


def _factor(reader: SetReader, frames: int, live: Mask) -> tuple[Array, float]:
    """Cholesky factor of the covariance of the mean of some frames of a press in the readings (m,) that live, and how
    large that covariance is over the one of training."""
    covariance, size = reader.superposition.covariance, 1.0
    if reader.frames:
        factor, white = _cholesky(covariance), reader.frames.of_mean(max(frames, 1))
        covariance, size = factor @ white @ factor.T, float(np.trace(white) / len(white))
    return _cholesky(covariance[np.ix_(live, live)]), size


def _slopes(reader: SetReader, pressed: Mask) -> Array:
    """(k', m) signals of one standard deviation of the amount of each of the places (k,) that are pressed."""
    learnt, k = reader.superposition, reader.places
    slope = learnt.pattern[:k].copy()
    for pair, more in zip(learnt.pairs, learnt.pattern[k:], strict=True):
        if pressed[pair].all():
            slope[pair] += more
    return (reader.loose[:, None] * slope)[pressed]


def _loosened(reader: SetReader, seen: Array, expected: Array, live: Mask, factor: Array) -> tuple[Array, Array]:
    """What unknown amounts take off the squared misfit (n, s) of whitened signals (n, m), and add to the logarithm of
    the determinant (s,)."""
    less, more = np.empty((len(seen), len(expected))), np.empty(len(expected))
    for number, pressed in enumerate(reader.sets):
        slope = _whitened(factor, _slopes(reader, pressed)[:, live])
        root = _cholesky(np.eye(len(slope)) + slope @ slope.T)
        less[:, number] = np.sum(_whitened(root, (seen - expected[number]) @ slope.T) ** 2, axis=1)
        more[number] = 2 * np.log(np.diag(root)).sum()
    return less, more


def _amounts(reader: SetReader, seen: _Seen, numbers: Index) -> tuple[Array, Array]:
    """Amounts (p, k) of the places of sets (p,), 0 where they are not pressed, and their standard deviations, 0 where
    amounts are not known."""
    sets, learnt = reader.sets, reader.superposition
    amount, sd = sets[numbers].astype(float), np.zeros((len(numbers), reader.places))
    if not reader.loose.any():
        return amount, sd
    means = learnt.means(design_of(sets.astype(float), learnt.pairs))
    for row, (one, frames, number) in enumerate(zip(seen.signal, seen.frames.tolist(), numbers.tolist(), strict=True)):
        live, pressed = np.isfinite(one), sets[number]
        factor, _ = _factor(reader, frames, live)
        slope = _whitened(factor, _slopes(reader, pressed)[:, live])
        off = _whitened(factor, (one - means[number])[None, live])[0]
        inverse = np.linalg.inv(np.eye(len(slope)) + slope @ slope.T)
        amount[row, pressed] += reader.loose[pressed] * (inverse @ slope @ off)
        sd[row, pressed] = reader.loose[pressed] * np.sqrt(np.diag(inverse))
    return amount, sd


def _log_posterior(score: Array) -> Array:
    """(n, s) logarithms of posteriors, all sets being as likely before."""
    return score - np.asarray(logsumexp(score, axis=1, keepdims=True))


def _cholesky(covariance: Array) -> Array:
    return np.asarray(np.linalg.cholesky(covariance), np.float64)


def _whitened(factor: Array, signal: Array) -> Array:
    return solve_triangular(factor, signal.T, lower=True).T
