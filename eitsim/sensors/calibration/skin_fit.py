"""The staged fit of a skin to labelled presses, each group of parameters kept where presses left out are better read.

What the calibrated sensor's own error adds to all presses, drawn D times, is E c with c normal of variance 1 / D, and
c is sought with the parameters. What else a press's readings miss they miss together, and different presses do not. So
all readings have one weight, and what they say is counted by how the presses' scores g_k = J_k' r_k scatter: s^2 =
tr((J'J)^-1 sum g_k g_k') / q in the place of a reading's variance. The covariance of parameters u and c, in prior
standard deviations, is P = ([J E]'[J E] / s^2 + 1)^-1; what groups that are not kept may be, by their prior, adds
P ([J E]'L / s^2) (L'[J E] / s^2) P, with L their derivatives.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array, Index, Mask

FEWEST = 10  # presses
_FOLDS = 5
_CLEARLY = 2.0  # standard errors by which presses left out must be better explained
_STEPS, _SETTLED = 6, 0.02  # most linearisations, and the change in prior standard deviations that ends them
_DIFFERENCE = 0.15  # of parameters, in prior standard deviations
_ROUNDS = 10  # of the variance
_ROBUST, _ODD = 1.4826, 5.0  # normal standard deviation over the median deviation, and how many make a press odd
_SHORTER = (1.0, 0.5, 0.25, 0.125)  # parts of a step that are tried


@dataclass(frozen=True, eq=False)
class SkinFit:
    """What the presses gave."""

    names: tuple[str, ...]  # (p,)
    value: Array  # (p,) 0 where the group is not kept
    covariance: Array  # (p, p) the prior's of groups that are not kept
    prior_sd: Array  # (p,)
    kept: tuple[str, ...]  # groups, in the order in which they were freed
    left: Mapping[str, float]  # group -> part of the signals, r.m.s. over presses left out, that stays with it freed
    before: float  # the same by the card as it is
    after: float  # and with what is kept
    size_error: float  # of presses left out: r.m.s. of the relative error of the signal's size
    pattern_error: float  # r.m.s. of what else is left, over the signal, 2-norm, without the readings' noise
    pattern_V: float  # r.m.s. of that, a reading, with the noise
    odd: Index  # presses that are missed by far more than the others

    @property
    def values(self) -> dict[str, float]:
        """Name -> value."""
        return dict(zip(self.names, self.value.tolist(), strict=True))


def fit_skin(signals: Callable[[Mapping[str, float]], Array], seen: Array, groups: Mapping[str, Mapping[str, float]], *,
             common: Array | None = None, noise_V: float = 0.0, seed: int = 0) -> SkinFit:
    """Fit the parameters of groups (group -> name -> prior standard deviation about 0) to signals (k, m), V, of at
    least FEWEST presses, signals of the model by the parameters' values; ValueError where it has none for the card.

    common: (draws, k, m) V errors of the signals that presses have in common; noise_V: standard deviation of a
    signal's reading by noise.
    """
    names = tuple(name for sds in groups.values() for name in sds)
    sd = np.array([value for sds in groups.values() for value in sds.values()])
    masks = {group: np.isin(names, list(sds)) for group, sds in groups.items()}
    fold = np.random.default_rng(seed).permutation(len(seen)) % _FOLDS
    size = np.linalg.norm(seen, axis=1)

    def model(white: Array) -> Array:
        return signals(dict(zip(names, (sd * white).tolist(), strict=True))) / size[:, None]

    drawn = np.empty((*seen.shape, 0)) if common is None else np.moveaxis(common / size[:, None], 0, -1)
    drawn = drawn / np.sqrt(max(drawn.shape[-1], 1))
    white = np.zeros(len(names))
    at = model(white)
    before = _share(seen / size[:, None] - at)
    for _ in range(_STEPS):
        near = _linearised(model, white, at, seen / size[:, None], drawn)
        kept, left = _staged(near, masks, fold)
        free = _of(masks, kept, len(names))
        found = near.minimum(free)
        if np.abs(found - white).max() < _SETTLED:
            break
        white, at = _step(model, white, found)
    out = near.left_out(free, fold)
    explained = seen / size[:, None] - out
    along = np.sum(out * explained, axis=1) / np.sum(explained**2, axis=1)
    pattern = out - along[:, None] * explained
    noises = seen.shape[1] * noise_V**2 * size**-2
    noise = np.mean(noises)
    return SkinFit(names, sd * found, sd[:, None] * near.covariance(free) * sd, sd, kept, left, before, _share(out),
                   float(np.sqrt(np.mean(along**2))), float(np.sqrt(max(_share(pattern) ** 2 - noise, 0.0))),
                   float(np.sqrt(np.mean((pattern * size[:, None]) ** 2))),
                   _odd(np.linalg.norm(out, axis=1), np.sqrt(noises)))


@dataclass(frozen=True, eq=False)
class _Linear:
    """Presses to first order: slope times the white parameters, with what all share, is the target."""

    target: Array  # (k, m) each press over the norm of its signal
    slope: Array  # (k, m, p)
    common: Array  # (k, m, draws) by white c

    def minimum(self, free: Mask, rows: Index | None = None) -> Array:
        """(p,) the most probable parameters by some presses, by all of them where none are given; 0 of others."""
        out = np.zeros(len(free))
        if free.any():
            out[free] = self._normal(free, np.arange(len(self.target)) if rows is None else rows)[0]
        return out

    def _normal(self, free: Mask, rows: Index) -> tuple[Array, float]:
        """(q,) most probable values, and the variance that counts for a reading's."""
        own, target = self.slope[rows][..., free], self.target[rows]
        every = np.concatenate([own, self.common[rows]], axis=-1)
        count, one = own.shape[-1], np.eye(every.shape[-1])
        gram, load = np.einsum("kmi,kmj->ij", every, every), np.einsum("kmi,km->i", every, target)
        inverse = np.linalg.pinv(gram[:count, :count], hermitian=True)
        white = np.concatenate([inverse @ load[:count], np.zeros(len(load) - count)])
        variance = 1.0
        for _ in range(_ROUNDS):
            scores = np.einsum("kmi,km->ki", own, target - every @ white)
            spread = np.sum(inverse * (scores.T @ scores)) / count * len(rows) / (len(rows) - count)
            variance = max(float(spread), np.finfo(float).eps)
            white = np.linalg.solve(gram / variance + one, load / variance)
        return white[:count], variance

    def left_out(self, free: Mask, fold: Index) -> Array:
        """(k, m) what parameters by the other folds leave of each press."""
        parts = [self.minimum(free, np.flatnonzero(fold != one)) for one in range(_FOLDS)]
        return self.target - np.einsum("kmi,ki->km", self.slope, np.array(parts)[fold])

    def covariance(self, free: Mask) -> Array:
        """(p, p) in prior standard deviations."""
        out = np.eye(len(free))
        if not free.any():
            return out
        _, variance = self._normal(free, np.arange(len(self.target)))
        every = np.concatenate([self.slope[..., free], self.common], axis=-1)
        inner = np.linalg.inv(np.einsum("kmi,kmj->ij", every, every) / variance + np.eye(every.shape[-1]))
        by_others = (inner @ np.einsum("kmi,kmj->ij", every, self.slope[..., ~free]) / variance)[:free.sum()]
        out[np.ix_(free, free)] = inner[:free.sum(), :free.sum()] + by_others @ by_others.T
        out[np.ix_(free, ~free)] = -by_others
        out[np.ix_(~free, free)] = -by_others.T
        return out


def _linearised(model: Callable[[Array], Array], white: Array, at: Array, seen: Array, common: Array) -> _Linear:
    slope = np.stack([_difference(model, white, at, one) for one in _DIFFERENCE * np.eye(len(white))], axis=-1)
    return _Linear(seen - at + slope @ white, slope, common)


def _difference(model: Callable[[Array], Array], white: Array, at: Array, step: Array) -> Array:
    """The model's slope along a step, or along the opposite one where the model has no answer."""
    try:
        return (model(white + step) - at) / _DIFFERENCE
    except ValueError:
        return (at - model(white - step)) / _DIFFERENCE


def _step(model: Callable[[Array], Array], white: Array, found: Array) -> tuple[Array, Array]:
    """The parameters found, or on the way to them the first that the model takes, and the model there."""
    for part in _SHORTER:
        try:
            return white + part * (found - white), model(white + part * (found - white))
        except ValueError:
            if part == _SHORTER[-1]:
                raise
    raise AssertionError


def _staged(near: _Linear, masks: Mapping[str, Mask], fold: Index) -> tuple[tuple[str, ...], dict[str, float]]:
    """Groups that are kept, in order, and what stays of presses left out with each. Those of which none helps alone are
    tried together at the end: what a thinner layer changes, a softer base may hide."""
    kept: tuple[str, ...] = ()
    count, shares, before = near.slope.shape[-1], {}, -1

    def after(groups: Sequence[str]) -> Array:
        return np.sum(near.left_out(_of(masks, groups, count), fold) ** 2, axis=1)

    left = after(kept)
    while len(kept) > before:
        before = len(kept)
        for group in (one for one in masks if one not in kept):
            now = after((*kept, group))
            shares[group] = float(np.sqrt(np.mean(now)))
            if _helps(left, now):
                kept, left = (*kept, group), now
    every = (*kept, *(one for one in masks if one not in kept))
    return every if len(every) > len(kept) + 1 and _helps(left, after(every)) else kept, shares


def _helps(left: Array, now: Array) -> bool:
    """Whether presses left out (k,) are clearly better explained. Where one gains by far the most its own scatter hides
    that, and what presses gain of their own counts too."""
    better = left - now
    return _clear(better) or (better.sum() > 0 and _clear(better / (left + now)))


def _clear(better: Array) -> bool:
    """Whether the sum of what presses gain (k,) is so many of its standard errors."""
    return float(better.sum()) > _CLEARLY * float(np.std(better, ddof=1)) * np.sqrt(len(better))


def _of(masks: Mapping[str, Mask], groups: Sequence[str], count: int) -> Mask:
    return np.any([np.zeros(count, dtype=bool), *(masks[group] for group in groups)], axis=0)


def _odd(left: Array, noise: Array) -> Index:
    """Presses of which more is left (k,) than _ODD robust standard deviations above the median, and noise (k,)."""
    middle = np.median(left)
    return np.flatnonzero(left - noise > middle + _ODD * _ROBUST * np.median(np.abs(left - middle)))


def _share(left: Array) -> float:
    """R.m.s. over presses of 2-norms (k, m)."""
    return float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
