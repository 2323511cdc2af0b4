"""How boards order their readings: drives that move round a ring of electrodes, and what is read of each.

Electrodes count as the readings do, from 0: where readings begin anew at the same electrode for every pattern, that
pair is 0 and 1; where they move with the drive, the first source is 0. So a convention says what the readings alone can
say; where electrode 0 lies on the body, and which way round they count, it leaves open.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from eitsim.scene.electrodes import FEWEST, MOST
from touchcal.arrays import Array, Index

MEAN = -1  # number of a minus electrode that stands for the mean of all of them
KEPT = ("undriven", "all", "open")
_ALL_FIRSTS = 32


@dataclass(frozen=True)
class Convention:
    """One order of readings of a ring; patterns outermost unless `by_reading`."""

    count: int  # electrodes
    patterns: int  # current patterns of a frame
    step: int  # electrodes from the source to the sink, as the readings count
    reference: str  # one of REFERENCES: minus is plus - read_step, the electrode before the source, the mean, the sink
    read_step: int  # electrodes from minus to plus of a pair; 0 for another reference
    kept: str  # one of KEPT: without driven electrodes, with them, or all pairs but that which closes the ring
    rotating: bool  # whether the first reading moves with the source
    first: int  # source of the first pattern; or, rotating, electrodes from the source to the first one read
    advance: int  # 1 where the source moves on as the readings count, -1 the other way
    by_reading: bool = False  # whether a frame lists all patterns of the first reading, then of the second ...
    then: int = 0  # `step` of a second drive, whose readings follow those of the first; 0 for one drive

    @property
    def pattern(self) -> str:
        """The pattern as `[drive] pattern` names it; of two drives both."""
        return " then ".join(pattern_name(step, self.count) for step in (self.step, self.then) if step)

    def pairs(self) -> Index:
        """(readings, 4) source, sink, plus and minus of each reading; minus MEAN for the mean of all electrodes."""
        if self.then:
            return np.concatenate([replace(self, step=step, then=0).pairs() for step in (self.step, self.then)])
        p, count = np.arange(self.patterns), self.count
        source = (self.advance * p + (0 if self.rotating else self.first)) % count
        sink = (source + self.step) % count
        start = (source + self.first if self.rotating else np.zeros(self.patterns, dtype=int))[:, None]
        plus_minus = self._read(source[:, None], sink[:, None], (start + np.arange(count)) % count)
        ends = np.stack(np.broadcast_arrays(source[:, None], sink[:, None], *plus_minus), axis=-1)
        kept = self._kept(ends)
        per = kept.sum(axis=1)
        if (per != per[0]).any():
            return np.empty((0, 4), dtype=np.intp)
        table = ends[kept].reshape(self.patterns, int(per[0]), 4)
        return (table.swapaxes(0, 1) if self.by_reading else table).reshape(-1, 4).astype(np.intp)

    def _read(self, source: Index, sink: Index, electrode: Index) -> tuple[Index, Index]:
        if self.reference == "pair":
            return (electrode + self.read_step) % self.count, electrode
        minus = {"before": (source - 1) % self.count, "mean": np.full_like(source, MEAN), "sink": sink}
        return electrode, np.broadcast_to(minus[self.reference], electrode.shape)

    def _kept(self, ends: Index) -> Any:
        source, sink, plus, minus = np.moveaxis(ends, -1, 0)
        different = plus != minus
        if self.kept == "all":
            return different
        if self.kept == "open":
            return different & (np.arange(self.count) < self.count - 1)
        driven = np.zeros(plus.shape, dtype=bool)
        for read in (plus, *([] if self.reference == "sink" else [minus])):
            driven |= (read == source) | (read == sink)
        return different & ~driven


def pattern_name(step: int, count: int) -> str:
    """The word for a sink `step` electrodes from the source."""
    step = min(step % count, -step % count)
    return "adjacent" if step == 1 else "opposite" if 2 * step == count else f"skip-{step - 1}"


def readings_of(patterns: int, count: int) -> dict[tuple[int, str, int, str], int]:
    """(step, reference, read_step, kept) -> readings of a frame of that many patterns."""
    out = {}
    for step in range(1, count // 2 + 1):
        kinds = [("pair", r, kept) for r in {1, step} for kept in KEPT if 2 * r < count and (kept != "open" or r == 1)]
        kinds += [("before", 0, "undriven"), *((ref, 0, kept) for ref in ("mean", "sink") for kept in KEPT[:2])]
        for reference, read_step, kept in kinds:
            one = Convention(count, patterns, step, reference, read_step, kept, False, 0, 1)
            out[step, reference, read_step, kept] = len(one.pairs())
    return out


def conventions(readings: int, count: int) -> Iterator[Convention]:
    """Every convention of that many electrodes whose frames have that many readings; of more than _ALL_FIRSTS
    electrodes only those that begin with electrode 0, the source or the sink."""
    for patterns in dict.fromkeys((count, count // 2)):
        for (step, reference, read_step, kept), made in readings_of(patterns, count).items():
            if made != readings or (patterns < count and 2 * step != count):
                continue
            shape = (count, patterns, step, reference, read_step, kept)
            for advance in (1, -1):
                for first in range(count) if count <= _ALL_FIRSTS else sorted({0, step}):
                    if reference != "before":
                        yield Convention(*shape, False, first, advance)
                    if kept != "open":
                        yield Convention(*shape, True, first, advance)
                        yield Convention(*shape, True, first, advance, by_reading=True)
    for step, then, kept in _two_drives(readings, count):
        for rotating, first, advance in itertools.product((False, True), range(count), (1, -1)):
            yield Convention(count, count, step, "pair", 1, kept, rotating, first, advance, then=then)


def _two_drives(readings: int, count: int) -> list[tuple[int, int, str]]:
    """Steps of two drives in turn, one of them to the neighbour, and what is kept, where a frame has that many
    readings; of _ALL_FIRSTS electrodes at most."""
    of = readings_of(count, count) if count <= _ALL_FIRSTS else {}
    both = [order for step in range(2, count // 2 + 1) for order in ((1, step), (step, 1))]
    return [(*steps, kept) for steps in both for kept in KEPT[:2]
            if sum(of.get((step, "pair", 1, kept), 0) for step in steps) == readings]


@lru_cache(maxsize=256)
def counts_for_two(readings: int) -> tuple[int, ...]:
    """As `counts_for`, where a frame has two drives in turn."""
    return tuple(count for count in range(FEWEST, _ALL_FIRSTS + 1) if _two_drives(readings, count))


@lru_cache(maxsize=256)
def counts_for(readings: int) -> tuple[int, ...]:
    """Numbers of electrodes that some convention makes that many readings of."""
    return tuple(count for count in range(FEWEST, MOST + 1) for patterns in dict.fromkeys((count, count // 2))
                 if readings % patterns == 0 and 0 < readings // patterns <= count
                 and readings in {made for key, made in readings_of(patterns, count).items()
                                  if patterns == count or 2 * key[0] == count})


def forms(pairs: Index, signed: bool) -> Index:
    """(readings, 5) what each reading is: its two pairs of electrodes, each and both sorted, and its sign.

    By reciprocity, exchanging what drives and what is read changes nothing; exchanging the ends of one of them changes
    the sign, which is 0 here where readings have none.
    """
    drive, read = np.sort(pairs[:, :2], axis=1), np.sort(pairs[:, 2:], axis=1)
    sign = np.where((pairs[:, 0] < pairs[:, 1]) == (pairs[:, 2] < pairs[:, 3]), 1, -1) * int(signed)
    swap = (drive[:, 0] > read[:, 0]) | ((drive[:, 0] == read[:, 0]) & (drive[:, 1] > read[:, 1]))
    one, other = np.where(swap[:, None], read, drive), np.where(swap[:, None], drive, read)
    return np.column_stack([one, other, sign])


def predicted(pairs: Index, kernel: Array) -> Array:
    """(readings,) of a ring whose transfer impedance from one electrode to another is kernel[turns between them]."""
    count = len(kernel)
    source, sink, plus, minus = pairs.T
    high = kernel[(source - plus) % count] - kernel[(sink - plus) % count]
    low = np.where(minus == MEAN, 0.0, kernel[(source - minus) % count] - kernel[(sink - minus) % count])
    return high - low
