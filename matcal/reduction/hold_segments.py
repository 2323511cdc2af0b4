"""Where a relaxation test holds its strain: one step and hold, or several of them."""

import numpy as np

from matcal.statistics.block_means import sample_noise
from touchcal.arrays import Array

# share of the largest travel within which a held crosshead stays, how much slower than the ramp it moves there, and how
# many times that band a ramp is at least
_STILL, _SLOWER, _RAMP = 2e-3, 0.1, 4.0


def find_holds(time: Array, travel: Array) -> list[tuple[int, int]]:
    """(first sample, one past the last) of every hold after the first motion of a record (n,) of time, s, and travel.
    In a hold the travel stays within 0.2 % of the largest (or within its noise), for at least ten times what the mean
    speed of the ramp before it would need to cross that band, and is away from where the record began."""
    band = band_of(travel)
    out, at, ramp_from, speed = [], 0, 0, 0.0
    while at < travel.size - 1:
        until = _stays(travel, at, band)
        span = float(time[until - 1] - time[at])
        moved, ramp_s = abs(travel[at] - travel[ramp_from]), float(time[at] - time[ramp_from])
        # a crosshead that overshoots and settles leaves a hold by a small and slow move, which is no ramp
        speed = moved / ramp_s if moved > _RAMP * band and ramp_s > 0 else speed
        slow = span * speed * _SLOWER > 2 * band
        if slow and until - at >= 3 and abs(travel[at]) > 10 * band:
            out.append((at, until))
        if until - at >= 3 and (slow or abs(travel[at]) <= 10 * band):
            ramp_from = until - 1
        at = until
    return _settled(travel, out, band)


def held_samples(time: Array, travel: Array) -> Array | None:
    """(n,) 1 in the holds of `find_holds`, 0 elsewhere; None where there is none."""
    held = np.zeros(time.size)
    for first, last in find_holds(time, travel):
        held[first:last] = 1.0
    return held if held.any() else None


def loading_start(travel: Array) -> int:
    """The last sample at rest before a travel (n,) first leaves it; 0 where the record begins away from rest."""
    away = np.abs(travel) > band_of(travel)
    return max(int(np.argmax(away)) - 1, 0)


def held_throughout(travel: Array) -> bool:
    """Whether a travel (n,) is held from its first sample to its last, away from zero: a step whose ramp is not in the
    record."""
    return bool(np.ptp(travel) <= 2 * band_of(travel) and np.abs(travel).min() > 0)


def band_of(travel: Array) -> float:
    """How far from its level a held travel (n,) may be: 0.2 % of the largest, or six times its noise."""
    return max(_STILL * float(np.abs(travel).max()), 6 * sample_noise(travel))


def _stays(travel: Array, at: int, band: float) -> int:
    """One past the last sample that stays within the band around sample `at`."""
    reach = 64
    while True:
        outside = np.flatnonzero(np.abs(travel[at:at + reach] - travel[at]) > band)
        if outside.size or at + reach >= travel.size:
            return at + int(outside[0]) if outside.size else travel.size
        reach *= 4


def _settled(travel: Array, holds: list[tuple[int, int]], band: float) -> list[tuple[int, int]]:
    """Holds that begin where the travel first comes close to their level, neighbours at one level joined."""
    out: list[tuple[int, int]] = []
    for first, last in holds:
        level = float(np.median(travel[first:last]))
        close = first + int(np.argmax(np.abs(travel[first:last] - level) < band / 4))
        if out and out[-1][1] >= first and abs(level - np.median(travel[slice(*out[-1])])) < 2 * band:
            out[-1] = (out[-1][0], last)
        else:
            out.append((close, last))
    return out
