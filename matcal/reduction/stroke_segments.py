"""The parts of a crosshead's record: rest, loadings, and what lies between and after them."""

from dataclasses import dataclass

import numpy as np

from matcal.statistics.block_means import sample_noise
from touchcal.arrays import Array

# share of the largest travel, and of the largest load, that a loading before the first has at least
_LEAST, _LOADED = 0.05, 0.02
_UPPER, _LOWER = 0.75, 0.60  # a loading passes the upper share of the largest travel after being below the lower


@dataclass(frozen=True)
class Stroke:
    """Where the loadings of a record lie."""

    travel: Array  # (n,) travel from rest, m, positive in the direction of loading
    sign: float  # 1.0 where the file's displacement grows under load, -1.0 where it falls
    start: int  # index of the first sample that moves
    end: int  # index of the first sample at the end of the first loading
    spans: tuple[tuple[int, int], ...]  # (first sample, first at the end) of every loading; the first is (start, end)
    noise_m: float  # noise of the displacement, m

    @property
    def loadings(self) -> int:
        """Number of loadings in the record."""
        return len(self.spans)


def find_stroke(displacement: Array) -> Stroke:
    """The loadings of a displacement record (n,), m; ValueError where nothing moves.

    A loading passes three quarters of the largest travel, ends where the travel first comes within its noise of the
    local extreme, and begins with the last sample at its lowest before; a fall below 60 % ends it, so that a new
    rise is a further loading.
    """
    noise = sample_noise(displacement)
    away = displacement - np.median(displacement[:_at_rest(displacement)])
    sign = 1.0 if away[np.argmax(np.abs(away))] > 0 else -1.0
    travel = sign * away
    largest = float(travel.max())
    margin = max(5 * noise, 1e-3 * largest)
    if largest <= 0 or np.count_nonzero(travel > margin) < 5:
        raise ValueError("the displacement never leaves its rest position")
    spans = _spans(travel, *_turns(travel, largest), margin)
    start, end = spans[0]
    return Stroke(travel, sign, start, end, spans, noise)


def with_smaller(stroke: Stroke, load: Array) -> Stroke:
    """The stroke with the loadings before its first that went less far, in which the load (n,), positive in loading,
    rose as well: cycles of growing travel. A move without load, as to position the crosshead, is none."""
    travel, margin = stroke.travel, max(5 * stroke.noise_m, 1e-3 * float(stroke.travel.max()))
    rise = int(np.flatnonzero(travel > _UPPER * travel.max())[0])
    rises, falls = _smaller(travel, rise, _LEAST * float(travel.max()))
    if not rises:
        return stroke
    spans = _spans(travel, [*rises, rise], [*falls, travel.size], margin)
    rest = float(np.median(load[:max(spans[0][0], 1)]))
    least = max(_LOADED * float(load[stroke.end] - rest), 6 * sample_noise(load))
    smaller = [span for span in spans[:-1] if np.median(load[max(span[1] - 2, 0):span[1] + 1]) - rest > least]
    whole = (*smaller, (spans[-1][0], stroke.end), *stroke.spans[1:])
    return Stroke(travel, stroke.sign, *whole[0], whole, stroke.noise_m)


def _smaller(travel: Array, until: int, least: float) -> tuple[list[int], list[int]]:
    """Rises and falls, as those of `_turns`, of the loadings before a sample that reached no further, of `least` travel
    or more."""
    top = np.maximum.accumulate(travel[:until])
    fallen = np.flatnonzero((travel[:until] < _LOWER * top) & (top > least))
    if not fallen.size:
        return [], []
    last = int(fallen[-1])
    rises, falls = _turns(travel[:last + 1], float(top[last]))
    before = _smaller(travel, rises[0], least)
    return [*before[0], *rises], [*before[1], *falls]


def _spans(travel: Array, rises: list[int], falls: list[int], margin: float) -> tuple[tuple[int, int], ...]:
    """(first sample, first at the end) of each loading."""
    spans = []
    for k, (rise, fall) in enumerate(zip(rises, falls, strict=True)):
        begin = falls[k - 1] if k else 0
        lowest = float(travel[begin:rise].min()) if k else 0.0
        low = np.flatnonzero(travel[begin:rise] <= lowest + margin)
        spans.append((begin + int(low[-1]) + 1 if low.size else begin, _end(travel, rise, fall, margin)))
    return tuple(spans)


def _at_rest(displacement: Array) -> int:
    """How many of the first samples stay together: the rest that the travel is measured from."""
    reach = 1e-3 * np.ptp(displacement)
    moved = np.flatnonzero(np.abs(displacement - displacement[0]) > max(reach, 6 * sample_noise(displacement)))
    return max(1, int(0.9 * moved[0])) if moved.size else displacement.size


def _turns(travel: Array, largest: float) -> tuple[list[int], list[int]]:
    """First sample of each loading above the upper level, and the first below the lower one after it (or the end)."""
    outside = np.flatnonzero((travel > _UPPER * largest) | (travel < _LOWER * largest))
    high = travel[outside] > _UPPER * largest
    change = np.diff(high.astype(int), prepend=0)
    rises, falls = outside[change == 1].tolist(), outside[change == -1].tolist()
    return rises, falls if len(falls) == len(rises) else [*falls, travel.size]


def _end(travel: Array, rise: int, fall: int, margin: float) -> int:
    """First sample within the margin of the first local extreme above 95 % of the loading's largest travel."""
    part = travel[rise:fall]
    high = int(np.argmax(part >= 0.95 * part.max()))
    low_again = np.flatnonzero(part[high:] < 0.9 * part.max())
    until = high + (int(low_again[0]) if low_again.size else part.size - high)
    return rise + high + int(np.argmax(part[high:until] >= part[high:until].max() - margin / 2))
