"""The order of readings put into words: what the data decide, and what they leave open."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.sensors.companions import FEWEST, LIKELY, supports
from eitsim.sensors.conventions import MEAN, pattern_name, predicted
from eitsim.sensors.disc_field import ring_kernel
from eitsim.sensors.order_evidence import CERTAIN, admitted, measuring_twice, reciprocal
from eitsim.sensors.outlined_skin import OutlinedSkin
from eitsim.sensors.recognition import (
    NEAREST,
    Account,
    Order,
    account_of,
    accounts,
    canonical,
    exchanged,
    stated_order,
    unordered,
)
from touchcal.arrays import Array, Index, Mask

# What a disc of this misfit or less says counts in full, since its error is noise; of a larger one, whose errors are
# those of the model and go together, the square of this over the misfit. A skin of the sensor file's outline is known.
_TRUSTED = 0.05
_NEARLY_ONE = 0.5  # readings that spread less than this about their mean, over their r.m.s., may stand upon an offset
_ONE = 0.2  # those that spread less than this do, or are of no disc: orders with and without an offset are left
_LEVEL = 0.7  # one number is added to all readings where that leaves less than this of what stays unexplained
# A disc that leaves more than this of a frame unexplained says nothing of its order.
EXPLAINED = 0.35
_MANY = 192  # orders that are compared with imperfect discs where none of those nearest to an even one is right
# Exchanged leads are looked for where the part unexplained lies between these, in the likeliest accounts.
_WELL, _HOPELESS, _TRIED = 0.02, 0.7, 4
_NEGATIVE = -0.02  # of the r.m.s.: a reading below it has a sign


@dataclass(frozen=True, eq=False)
class Identified:
    """What is known of the order of readings."""

    plausible: tuple[Order, ...]  # orders that the data do not exclude, the likeliest first; empty where none is known
    # "file" that states it; "disc" or, with an outline, "skin"; "driven", which readings hold no measurement; "touches"
    # or "nothing"
    decided_by: str
    sign: str  # "positive", "negative", "magnitude", "either" (magnitudes look the same) or "unknown"
    unexplained: float  # 2-norm of what an imperfect homogeneous body misses over that of the frame; NaN without one
    swapped: tuple[int, int] | None = None  # electrodes, as the order counts them, that look exchanged
    level: float = 0.0  # what is added to all readings, over the untouched frame's r.m.s.
    # whether several orders are left of which none may be right, since the body in question is no homogeneous one
    doubtful: bool = False

    @property
    def order(self) -> Order | None:
        """The one order that is left, else None."""
        return self.plausible[0] if len(self.plausible) == 1 else None

    def words(self) -> dict[str, str | None]:
        """What all plausible orders have in common, by "pattern", "order", "turn" and "direction"; None: open."""
        said = [] if self.doubtful else [words_of(one) for one in self.plausible]
        return {key: said[0][key] if said and all(one[key] == said[0][key] for one in said) else None
                for key in ("pattern", "order", "turn", "direction")}


def words_of(order: Order) -> dict[str, str]:
    """An order in words; electrodes count from 0 as the readings do."""
    pairs, count, one = order.pairs, order.count, order.convention
    step = np.unique(np.minimum((pairs[:, 1] - pairs[:, 0]) % count, (pairs[:, 0] - pairs[:, 1]) % count))
    pattern = one.pattern if one else pattern_name(int(step[0]), count) if len(step) == 1 else "several drives"
    if one is None and order.stated:
        said = "as the recording's file states"
        return {"pattern": pattern, "order": said, "turn": said, "direction": said}
    if one is None:
        way, turn = order.moved or (1, 0)
        return {"pattern": pattern, "order": "as in the sensor file",
                "turn": "as in the sensor file" if turn == 0 else f"drives turned by {turn} electrodes against what is "
                                                                 "read, from the sensor file",
                "direction": "as in the sensor file" if way == 1 else "drives numbered the other way round than in the "
                                                                      "sensor file"}
    read = {"pair": "neighbours" if one.read_step == 1 else f"pairs {one.read_step} electrodes from each other",
            "before": "each electrode against the one before the source",
            "mean": "each electrode against the mean of all", "sink": "each electrode against the sink"}[one.reference]
    kept = {"undriven": "without driven electrodes", "all": "with driven electrodes",
            "open": "with driven electrodes, without the pair that closes the ring"}[one.kept]
    begins = "beginning at the source of each pattern" if one.rotating else "beginning at the same pair in each pattern"
    outer = "reading by reading" if one.by_reading else "pattern by pattern"
    first = int(pairs[0, 2] if pairs[0, 3] == MEAN or one.reference != "pair" else pairs[0, 3])
    away = (first - int(pairs[0, 0])) % count
    turn = (f"the first reading begins {away} electrodes from the source" if one.rotating else
            f"the first pattern drives from electrode {int(pairs[0, 0])}")
    return {"pattern": pattern, "order": f"{read}, {kept}, {begins}, {outer}", "turn": turn,
            "direction": "drives move as the readings count" if one.advance == 1 else
            "drives move against the count of the readings"}


def identified(profile: Array | None, signals: Array, orders: Sequence[Order], *, kind: str,
               silent: Mask | None = None, expected: Index | None = None,
               skin: OutlinedSkin | None = None) -> Identified:
    """The orders that may have made an untouched frame (readings,), or signals (frames, readings) of touches.

    kind: "voltage", "magnitude", or "difference", whose signals have no untouched frame; silent: (readings,) which hold
    no measurement. These, and reciprocity, exclude orders first, whatever the body (`order_evidence`). Of the orders
    left an imperfect homogeneous disc decides where it explains the frame, and better than one number for all readings
    does, otherwise the touches where there are enough. expected: pairs of the order that a sensor file describes; skin:
    where that has an outline, the homogeneous skin in the disc's place.
    """
    if not orders:
        return Identified((), "nothing", _sign_alone(kind), np.nan)
    unexplained, sign, level = np.nan, _sign_alone(kind), 0.0
    silent = np.zeros(len(orders[0].pairs), dtype=bool) if silent is None else silent
    left = admitted(profile, silent, orders)
    if profile is not None:
        fit, found = _fit_of_kind(profile, left, kind, skin)
        if fit.unexplained > _TRUSTED and len(fewer := measuring_twice(profile, left)) < len(left):
            left = fewer
            fit, found = _fit_of_kind(profile, left, kind, skin)
        if fit.unexplained > EXPLAINED and skin is None:
            fit, found = _fit_of_kind(profile, left, kind, skin, most=_MANY)
        unexplained, level = fit.unexplained, fit.level
        if unexplained < EXPLAINED and fit.log_likelihood > unordered(profile) + CERTAIN:
            kept, doubtful = fit.orders, fit.counts < 1
            if doubtful:
                kept = _one_each([*kept, *reciprocal(profile, left)])
                sure = kind == "magnitude" or has_sign(profile) or (
                    found == "magnitude" and len(kept) == 1 and _of_both_signs(kept[0]))
                found = found if sure else "unknown"
            return Identified(kept, "disc" if skin is None else "skin", found, unexplained, fit.swapped, level,
                              doubtful and len(kept) > 1)
    if silent.any() and len(_one_each(left)) == 1:
        return Identified((left[0],), "driven", sign, unexplained)
    if len(signals) >= FEWEST:
        likely = supports(signals, left, expected)
        least = max(likely[0].log_likelihood, LIKELY) - LIKELY if likely else 0.0
        kept = [one.order for one in likely if one.log_likelihood > least]
        if not kept:
            return Identified((), "nothing", sign, unexplained)
        if profile is not None and sign == "unknown" and all(_of_both_signs(one) for one in kept) and not has_sign(
                profile):
            sign = "magnitude"
        return Identified(tuple(kept), "touches", sign, unexplained)
    return Identified((), "nothing", sign, unexplained)


def stated(profile: Array | None, pairs: Index, *, kind: str) -> Identified:
    """The order that a recording's file states, by pairs (readings, 4), which no model is asked about; the sign is that
    of the disc which an untouched frame (readings,) fits, where one does."""
    order = stated_order(pairs)
    if profile is None:
        return Identified((order,), "file", _sign_alone(kind), np.nan)
    found = account_of(profile, order, signed=kind != "magnitude")
    sign = {1: "positive", -1: "negative", 0: "magnitude"}[found.sign] if found.unexplained < EXPLAINED else (
        _sign_alone(kind))
    return Identified((order,), "file", sign, found.unexplained)


def _one_each(orders: Sequence[Order]) -> tuple[Order, ...]:
    """The first of each set of orders that no ring can tell."""
    found: dict[tuple[int, bytes], Order] = {}
    for one in orders:
        found.setdefault((one.count, canonical(one.pairs, one.count, False)), one)
    return tuple(found.values())


@dataclass(frozen=True, eq=False)
class _Fit:
    """The orders by which a disc accounts for a frame."""

    orders: tuple[Order, ...]  # the likeliest first
    log_likelihood: float
    unexplained: float
    sign: int  # of the likeliest
    counts: float  # how much of what the disc says counts, from 0 to 1
    swapped: tuple[int, int] | None = None
    level: float = 0.0


def _fit_of_kind(profile: Array, orders: Sequence[Order], kind: str, skin: OutlinedSkin | None, *,
                 most: int = NEAREST) -> tuple[_Fit, str]:
    """The fit of a frame and its sign; of one without negative readings the better with and without sign, or with one
    number added to all readings where that explains far more."""
    if kind == "magnitude":
        return _fit(profile, orders, skin, signed=False, most=most), "magnitude"
    fit = _fit(profile, orders, skin, signed=True, most=most)
    sign = {1: "positive", -1: "negative"}[fit.sign]
    if not has_sign(profile):
        sizes = _fit(profile, orders, skin, signed=False, most=most)
        fit, sign = (sizes, "magnitude") if sizes.log_likelihood > fit.log_likelihood + CERTAIN else (fit, "either")
    spread = _spread(profile)
    if skin is None and (fit.counts < 1 or spread < _NEARLY_ONE):
        on = _fit(profile, orders, None, signed=True, level=True, most=most)
        if on.log_likelihood > fit.log_likelihood + CERTAIN and on.unexplained * spread < _LEVEL * fit.unexplained:
            return on, {1: "positive", -1: "negative"}[on.sign]
        if spread < _ONE:
            return replace(fit, orders=_one_each([*fit.orders, *on.orders]), counts=0.0), sign
    return fit, sign


def _fit(profile: Array, orders: Sequence[Order], skin: OutlinedSkin | None, *, signed: bool,
         level: bool = False, most: int = NEAREST) -> _Fit:
    """The likeliest orders, with two leads exchanged where that alone makes one of them much better."""
    best = accounts(profile, orders, signed=signed, skin=skin, level=level, most=most)
    spread = 1.0 if level else _spread(profile)
    if not level and (found := _with_exchange(profile, best, spread, skin)) is not None:
        return found
    first = best[0]
    counts = _counts(first, spread, skin)
    kept = tuple(one.order for one in best if counts * (first.log_likelihood - one.log_likelihood) < CERTAIN)
    return _Fit(kept, first.log_likelihood, first.unexplained, first.sign, counts, level=first.level)


def _with_exchange(profile: Array, best: Sequence[Account], spread: float, skin: OutlinedSkin | None) -> _Fit | None:
    """The likeliest order with two leads exchanged, where that is likelier than none and any other exchange."""
    first = best[0]
    if not _WELL < first.unexplained < _HOPELESS:
        return None
    tried = sorted((new for one in best[:_TRIED] for new in _exchanges(profile, one, skin)),
                   key=lambda each: -each[0].log_likelihood)
    (new, order, leads), rest = tried[0], [first, *(one for one, _, _ in tried[1:])]
    counts = _counts(new, spread, skin)
    if any(counts * (new.log_likelihood - other.log_likelihood) <= CERTAIN for other in rest):
        return None
    return _Fit((order,), new.log_likelihood, new.unexplained, new.sign, 1.0, leads)


def _counts(account: Account, spread: float, skin: OutlinedSkin | None) -> float:
    """How much of what an account says counts, from 0 to 1."""
    return min(1.0, (_TRUSTED * spread / account.unexplained) ** 2) if skin is None else 1.0


def _spread(profile: Array) -> float:
    """Standard deviation of a frame's readings over their r.m.s."""
    return float(np.nanstd(profile) / np.sqrt(np.nanmean(profile**2)))


def _exchanges(profile: Array, one: Account,
               skin: OutlinedSkin | None) -> list[tuple[Account, Order, tuple[int, int]]]:
    """Accounts of an order with the leads of two electrodes exchanged, the order, and these electrodes."""
    leads = list(itertools.combinations(range(one.order.count), 2))
    orders = [exchanged(one.order, *ends) for ends in leads]
    of = {order.pairs.tobytes(): ends for order, ends in zip(orders, leads, strict=True)}
    return [(new, one.order, of[new.order.pairs.tobytes()])
            for new in accounts(profile, orders, signed=one.sign != 0, skin=skin)]


def has_sign(profile: Array) -> bool:
    """Whether some of the readings are negative by more than noise."""
    return bool(np.nanmin(profile) < _NEGATIVE * np.sqrt(np.nanmean(profile**2)))


def _sign_alone(kind: str) -> str:
    """What a frame says of its sign without an order."""
    if kind == "magnitude":
        return "magnitude"
    return "unknown"


def _of_both_signs(order: Order) -> bool:
    """Whether an even disc gives readings of both signs in this order."""
    return len(np.unique(np.sign(predicted(order.pairs, ring_kernel(order.count, 0.5))))) > 1
