"""What readings say of an order without a model of the body.

Readings that hold no measurement are those of driven electrodes, of dead electrodes or of dead channels: an order under
which they are has the marginal likelihood of the few exceptions that are left. By reciprocity readings with drive and
measurement exchanged are the same, whatever the body, and whatever is added to all readings. Both exclude orders before
a disc compares those that are left, since no error of a model makes either. So does what a frame measures twice, most
often with source and sink exchanged, where no disc explains the frame: of an even one many readings are the same.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import betaln

from eitsim.sensors.conventions import MEAN
from eitsim.sensors.recognition import Order
from touchcal.arrays import Array, Index, Mask

CERTAIN = 8.0  # orders that are this much less likely than the best, in natural logarithms, are excluded
# Exceptions are as likely as Beta(1, _RARE) has them; at most so many dead electrodes or channels are looked for.
_RARE, _MOST_DEAD = 20.0, 3
_ALIVE = 10.0  # odds against one more of them
# Readings exchanged are the same where they are this close to each other, over their spread; orders under which they
# are so many times farther from each other, and farther than the least that counts, are excluded.
_RECIPROCAL, _FARTHER, _LEAST = 0.15, 3.0, 0.1
# Readings taken twice are the same where they are this close to each other; one an electrode, at least.
_TWICE = 0.05
_MOSTLY = 0.5  # more than this part of the readings at driven electrodes is not taken by a board that takes none


def admitted(profile: Array | None, silent: Mask, orders: Sequence[Order]) -> list[Order]:
    """The orders that readings which hold no measurement, and reciprocity, do not exclude.

    profile: (readings,) of an untouched frame, NaN where there is no measurement; silent: (readings,) where that is.
    """
    kept = list(orders)
    if silent.any() and not silent.all():
        likely = np.array([silence(one, silent) for one in kept])
        if likely.max() > _without_order(silent) + CERTAIN:
            kept = [one for one, log in zip(kept, likely, strict=True) if log > likely.max() - CERTAIN]
    if profile is None:
        return kept
    exchanged = np.array([exchanged_difference(profile, one.pairs) for one in kept])
    least = np.nanmin(exchanged) if np.isfinite(exchanged).any() else np.inf
    if least > _RECIPROCAL:
        return kept
    return [one for one, off in zip(kept, exchanged, strict=True) if not off > max(_FARTHER * least, _LEAST)]


def measuring_twice(profile: Array, orders: Sequence[Order]) -> list[Order]:
    """The orders that what a frame (readings,) measures twice leaves: where some say that readings which are the same
    are so, those and the reciprocal ones that measure nothing twice, since an even ring has readings that mirror each
    other; else all."""
    repeated = np.array([repeated_difference(profile, one.pairs) for one in orders])
    if not (repeated <= _TWICE).any():
        return list(orders)
    most = max(_FARTHER * np.nanmin(repeated), _TWICE)
    return [one for one, off in zip(orders, repeated, strict=True)
            if off <= most or (np.isnan(off) and exchanged_difference(profile, one.pairs) <= _RECIPROCAL)]


def reciprocal(profile: Array, orders: Sequence[Order]) -> list[Order]:
    """The orders under which readings with drive and measurement exchanged are the same."""
    return [one for one in orders if exchanged_difference(profile, one.pairs) <= _RECIPROCAL]


def vouched(profile: Array | None, silent: Mask, order: Order) -> bool:
    """Whether readings that hold no measurement are those of driven electrodes under an order, reciprocity holds, or
    what is measured twice is the same."""
    none, *driven = _silences(order, silent)
    return max(driven) > none + CERTAIN or (profile is not None and (
        bool(reciprocal(profile, [order])) or repeated_difference(profile, order.pairs) <= _TWICE))


def as_silent(order: Order, others: Sequence[Order], silent: Mask) -> bool:
    """Whether readings that hold no measurement are about as likely under an order as under others."""
    return not silent.any() or silence(order, silent) > max(silence(one, silent) for one in others) - CERTAIN


def at_driven(pairs: Index) -> Mask:
    """(readings,) which readings are taken at an electrode that carries current."""
    return np.asarray((pairs[:, :2, None] == pairs[:, None, 2:]).any(axis=(1, 2)))


def not_taken(pairs: Index, silent: Mask) -> Mask:
    """(readings,) which of the readings that hold no measurement (readings,) the board does not take, rather than being
    dead: those at driven electrodes, or between them, where most of these hold none."""
    return not_taken_of((at_driven(pairs), _at_both(pairs)), silent)


def not_taken_of(groups: Sequence[Mask], silent: Mask) -> Mask:
    """As `not_taken`, of the first of some groups of readings most of which hold no measurement."""
    for group in groups:
        if group.any() and silent[group].mean() > _MOSTLY:
            return silent & group
    return np.zeros_like(silent)


def silence(order: Order, silent: Mask) -> float:
    """Natural logarithm of the marginal likelihood that just these readings (readings,) hold no measurement."""
    return max(_silences(order, silent))


def _silences(order: Order, silent: Mask) -> list[float]:
    """The same where driven electrodes are read, where they are not, and where only the driven pair is not."""
    pairs, count = order.pairs, order.count
    driven, unit = at_driven(pairs), np.arange(count)[:, None]
    read = (pairs[:, 2:] == unit[..., None]).any(axis=-1)
    _, channel = np.unique(pairs[:, 2:], axis=0, return_inverse=True)
    channels = np.ravel(channel) == np.arange(channel.max() + 1)[:, None]
    dead = np.concatenate([read, read | (pairs[:, :2] == unit[..., None]).any(axis=-1), channels])
    return [_explained(base, dead, silent) for base in (np.zeros_like(driven), driven, _at_both(pairs))]


def _at_both(pairs: Index) -> Mask:
    """Readings between the two electrodes that carry current."""
    return np.asarray((pairs[:, :2, None] == pairs[:, None, 2:]).any(axis=1).all(axis=1))


def _explained(base: Mask, dead: Mask, silent: Mask) -> float:
    """The likelihood with these readings left out, and the dead electrodes or channels (n, readings) that make it
    largest, each as likely as any other."""
    best = _likelihood(base, silent)
    for number in range(1, _MOST_DEAD + 1):
        wrong = ((base | dead) != silent).sum(axis=1)
        base = base | dead[int(np.argmin(wrong))]
        best = max(best, _likelihood(base, silent) - number * float(np.log(_ALIVE * len(dead))))
    return best


def _without_order(silent: Mask) -> float:
    """The likelihood where readings hold no measurement at random, however many: at the end of a range that is too
    small for a part of them."""
    return float(betaln(1 + silent.sum(), 1 + (~silent).sum()))


def _likelihood(expected: Mask, silent: Mask) -> float:
    wrong = int((expected != silent).sum())
    return float(betaln(1 + wrong, _RARE + len(silent) - wrong) - betaln(1, _RARE))


def exchanged_difference(profile: Array, pairs: Index) -> float:
    """How far readings with drive and measurement exchanged are from each other, their sizes, over what they are from
    their mean, 2-norms; NaN where fewer than a reading of each pattern have a counterpart."""
    if (pairs == MEAN).any():
        return np.nan
    count, name, exchanged = _names(pairs)
    order = np.argsort(name, kind="stable")
    place = order[np.minimum(np.searchsorted(name[order], exchanged), len(order) - 1)]
    there = (name[place] == exchanged) & (place > np.arange(len(pairs)))
    return _apart(profile[there], profile[place[there]], max(count / 2, 4))


def repeated_difference(profile: Array, pairs: Index) -> float:
    """The same of readings of the same electrodes under the same drive, either way round; NaN where they are fewer than
    the electrodes."""
    count, name, _ = _names(pairs)
    order = np.argsort(name, kind="stable")
    again = np.diff(name[order]) == 0
    return _apart(profile[order[:-1][again]], profile[order[1:][again]], count)


def _names(pairs: Index) -> tuple[int, Index, Index]:
    """How many electrodes there are, and (readings,) a number of each drive and reading, and of the two exchanged."""
    count = int(pairs.max()) + 1
    drive, read = (np.sort(ends, axis=1) @ (count + 1, 1) for ends in (pairs[:, :2], pairs[:, 2:]))
    return count, drive * (count + 1) ** 2 + read, read * (count + 1) ** 2 + drive


def _apart(one: Array, other: Array, fewest: float) -> float:
    both = np.isfinite(one) & np.isfinite(other)
    one, other = np.abs(one[both]), np.abs(other[both])
    if both.sum() < fewest:
        return np.nan
    middle = (one.mean() + other.mean()) / 2
    spread = np.sum((one - middle) ** 2) + np.sum((other - middle) ** 2)
    return float(np.sqrt(2 * np.sum((one - other) ** 2) / spread)) if spread else np.nan
