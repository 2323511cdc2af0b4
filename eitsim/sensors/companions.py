"""Which order touches speak for: what is read of one pair of electrodes under neighbouring currents changes together.

This needs no model of the body and no sign, and holds where the readings are no voltages of a disc. Each reading of a
drive chooses its companion among the readings of the next with a probability that grows with their correlation; an
order is as likely as the companions that it makes. The readings of one drive are not independent: they count as one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import rankdata

from eitsim.sensors.recognition import Order, canonical, driven
from touchcal.arrays import Array, Index, Mask

LIKELY = 3.0  # orders this much less likely than the best, in natural logarithms, are excluded
FEWEST = 30  # frames of touches that correlations are taken from
_MOST = 160  # orders that are compared closely
_MOST_CORRELATED, _SHARPNESS = 0.999, (1.0, 2.0, 4.0, 8.0, 16.0)
# Odds against orders that are not the one that a sensor file describes; without one, against those that boards do not
# have, which begin with electrode 0 and go on as the readings count. Neither decides alone: LIKELY asks for more.
_DESCRIBED, _USUAL = 20.0, 10.0
# A reading follows one frame late where it correlates this much more with the frame before, this many standard
# deviations more, and this much at all. Late are those at an end of the row of which this part follows so.
_LATE, _SIGNIFICANT, _CLEAR, _MOSTLY = 0.1, 5.0, 0.3, 0.8


@dataclass(frozen=True, eq=False)
class Support:
    """How much touches speak for an order."""

    order: Order
    log_likelihood: float  # natural logarithm, over companions chosen at random, with the odds of unusual orders


def supports(signals: Array, orders: Sequence[Order], expected: Index | None = None) -> list[Support]:
    """Orders by the companions that they make in signals (frames, readings) of touches, the likeliest first, one of
    each set that no ring can tell; orders whose drives have no neighbours are left out. Empty where some orders read
    driven electrodes: without gaps that move with the drive, companions say too little; where the frames are worth
    fewer than FEWEST independent ones. expected: pairs of the order that a sensor file describes."""
    if independent(signals) < FEWEST or any(driven(one.pairs) for one in orders):
        return []
    table = np.arctanh(np.clip(np.abs(_correlations(signals, signals)), 0, _MOST_CORRELATED))
    np.fill_diagonal(table, 0.0)
    table = np.nan_to_num(table)
    near: dict[tuple[int, bytes], tuple[Order, Index]] = {}
    placed = [(one, place) for one in orders if (place := _places(one)) is not None]
    for one, place in sorted(placed, key=lambda each: (-_companionship(each[1], table), not _usual(each[0]))):
        near.setdefault((one.count, canonical(one.pairs, one.count, False)), (one, place))
        if len(near) == _MOST:
            break
    if not near:
        return []
    chosen = []
    for sharpness in _SHARPNESS:
        choices = _Choices(sharpness * table, {})
        chosen.append([_chosen(place, choices) for _, place in near.values()])
    best = max(chosen, key=max)
    hoped = {(one.count, canonical(expected, one.count, False)) for one in orders[:1]} if expected is not None else {
        key for key, (one, _) in near.items() if _usual(one)}
    odds = _USUAL if expected is None else _DESCRIBED
    made = [Support(one, float(log) - (0.0 if key in hoped else np.log(odds)))
            for (key, (one, _)), log in zip(near.items(), best, strict=True)]
    return sorted(made, key=lambda one: -one.log_likelihood)


def independent(signals: Array) -> float:
    """How many independent frames signals (frames, readings) in time order are worth, by the rank correlation r of
    successive ones: n (1 - r) / (1 + r), r the median over readings. Of a target that moves slowly they are few."""
    if len(signals) < 3:
        return float(len(signals))
    rank = _ranks(signals)
    here = np.isfinite(rank).all(axis=0) & rank.any(axis=0)
    if not here.any():
        return 0.0
    rank = rank[:, here]
    lasting = float(np.median(np.sum(rank[1:] * rank[:-1], axis=0) / np.sum(rank**2, axis=0)))
    return len(signals) * (1 - max(lasting, 0.0)) / (1 + max(lasting, 0.0))


def late_readings(signals: Array) -> Mask:
    """(readings,) which of the readings in signals (frames, readings), in time order, belong to the frame before: they
    change with the others' earlier frame more than with their own, and are all at one end of the row. None where
    successive frames are too near each other to tell a frame's delay from a slow change."""
    none, frames = np.zeros(signals.shape[1], dtype=bool), independent(signals)
    if frames < FEWEST:
        return none
    now, before = (np.nan_to_num(np.abs(_correlations(signals[1:], part))) for part in (signals[1:], signals[:-1]))
    for part in (now, before):
        np.fill_diagonal(part, 0.0)
    own, earlier = (np.quantile(np.minimum(part, _MOST_CORRELATED), 0.9, axis=1) for part in (now, before))
    follow = (earlier > own + _LATE) & (earlier > _CLEAR)
    clearly = (np.arctanh(earlier) - np.arctanh(own)) * np.sqrt((frames - 3) / 2) > _SIGNIFICANT
    first, last = _run(follow, clearly), _run(follow[::-1], clearly[::-1])
    return (np.arange(len(none)) < first) | (np.arange(len(none)) >= len(none) - last)


def _run(follow: Mask, clearly: Mask) -> int:
    """How many readings at the start of a row follow, nearly all of them and most clearly, up to one that does."""
    number = np.arange(1, len(follow) + 1)
    ends = np.flatnonzero(follow & (np.cumsum(follow) >= _MOSTLY * number) & (np.cumsum(clearly) >= number / 2))
    return int(ends[-1]) + 1 if len(ends) else 0


def in_step(signals: Array, late: Mask) -> Array:
    """Signals with the late readings taken from the next row; one frame less where there are any."""
    return np.where(late, signals[1:], signals[:-1]) if late.any() else signals


def _usual(order: Order) -> bool:
    one = order.convention
    return one is None or (one.advance == 1 and (one.rotating or one.first == 0))


def _places(order: Order) -> Index | None:
    """(electrodes, channels) number of the reading of each channel by the source, -1 for none; None where the sink is
    not always as many electrodes from the source."""
    pairs, count = order.pairs, order.count
    step = (pairs[:, 1] - pairs[:, 0]) % count
    if (step != step[0]).any():
        return None
    _, channel = np.unique(pairs[:, 2:], axis=0, return_inverse=True)
    place = np.full((count, int(channel.max()) + 1), -1, dtype=np.intp)
    place[pairs[:, 0], np.ravel(channel)] = np.arange(len(pairs))
    return place if ((place >= 0) & (np.roll(place, -1, axis=0) >= 0)).any() else None


def _companionship(place: Index, table: Array) -> float:
    after = np.roll(place, -1, axis=0)
    both = (place >= 0) & (after >= 0)
    return float(table[place[both], after[both]].mean())


@dataclass(frozen=True, eq=False)
class _Choices:
    """How readings choose companions: by this table (readings, readings) of logarithms."""

    table: Array
    # logarithm of the mean over the readings that a reading may choose among, by the readings of two drives
    free: dict[tuple[bytes, bytes], Array]

    def gained(self, here: Index, there: Index, both: Mask) -> tuple[float, int]:
        """Log likelihood of the companions of one drive's readings over random ones, and their number; -1: none."""
        own, other = here[here >= 0], there[there >= 0]
        key = own.tobytes(), other.tobytes()
        if key not in self.free:
            among = self.table[np.ix_(own, other)]
            self.free[key] = logsumexp(among, axis=1) - np.log(among.shape[1])
        return float((self.table[here[both], there[both]] - self.free[key][both[here >= 0]]).sum()), len(own)


def _chosen(place: Index, choices: _Choices) -> float:
    """Log likelihood of an order's companions over random ones, both ways round, the readings of one drive as one."""
    total = 0.0
    for shift in (-1, 1):
        for here, there in zip(place, np.roll(place, shift, axis=0), strict=True):
            both = (here >= 0) & (there >= 0)
            if both.any():
                gained, count = choices.gained(here, there, both)
                total += gained / (2 * count)
    return total


def _correlations(one: Array, other: Array) -> Array:
    """(readings, readings) rank correlations; NaN for readings that are dead or never change."""
    scaled = []
    for part in (one, other):
        rank = _ranks(part)
        size = np.linalg.norm(rank, axis=0)
        scaled.append(rank / np.where(size > 0, size, np.nan))
    return scaled[0].T @ scaled[1]


def _ranks(part: Array) -> Array:
    """(frames, readings) ranks less their mean; NaN for readings that are dead in a frame."""
    rank = rankdata(part, axis=0)
    rank[:, np.isnan(part).any(axis=0)] = np.nan
    return rank - rank.mean(axis=0)
