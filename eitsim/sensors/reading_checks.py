"""What readings say of the instrument without a model: dead channels, repeats, reciprocity.

Two lists of numbers that should be the same, a and later b, are |a - b| / |a| from each other, 2-norms.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from eitsim.sensors.recording import Recording, in_phase
from eitsim.sensors.unmeasured import unmeasured
from touchcal.arrays import Array, Index, Mask

# Readings that an ohmmeter makes the same and that, all together, differ by as much as they are have nothing in common:
# no model of a passive body is made of them. Gains against ground alone may well make half of that.
NO_OHMMETER = 1.0
_MOSTLY = 0.8  # an electrode is dead where this part of its readings is
_SILENT = 0.1  # an electrode is dead whose readings are this part of a model's, where the median electrode's are all
_HALF = 0.5  # of its median size, above which all values of a reading are that a 0 among them is none
_STILL = 10  # frames over which a reading of a board with few bits may well not change


@dataclass(frozen=True)
class Apart:
    """How far from each other readings are that a linear, reciprocal instrument would make the same."""

    least: float
    median: float
    most: float
    together: float  # of all lists in one
    compared: int  # pairs of lists that were compared


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Consecutive readings of one current."""

    source: int
    sink: int
    ends: Index  # (n, 2) plus and minus
    values: Array  # (frames, n) over the current


def dead_readings(recording: Recording) -> Mask:
    """(readings,) which hold no measurement: empty, 0 or at the end of the range in every frame, or unchanging over ten
    frames or more where others change."""
    values = recording.readings
    dead = unmeasured(in_phase(values))
    if len(values) >= _STILL:
        still = (values == values[0]).all(axis=0)
        dead |= still & (not still.all())
    return dead


def without_drop_outs(recording: Recording) -> tuple[Recording, int]:
    """The recording without frames in which a reading is 0 that otherwise is never less than half its median size, and
    how many these are; of differences, which may be 0, all frames stay."""
    size = np.abs(recording.readings)
    typical = np.median(np.nan_to_num(size), axis=0)
    never = (typical > 0) & (np.where(size > 0, size, np.inf).min(axis=0) > _HALF * typical)
    kept = ~((size == 0) & never).any(axis=1) | (recording.kind == "difference")
    clock = None if recording.time_s is None else recording.time_s[kept]
    return replace(recording, readings=recording.readings[kept], index=recording.index[kept], time_s=clock,
                   touch=recording.touch[kept]), int((~kept).sum())


def dead_electrodes(dead: Mask, uses: Iterable[Mask]) -> dict[int, float]:
    """Electrodes, from 0, most of whose readings are dead while other readings are not, and what part; `uses`: for each
    which readings (m,) are taken at it."""
    if dead.all() or not dead.any():
        return {}
    shares = [float(dead[use].mean()) if use.any() else 0.0 for use in uses]
    worst = max(shares)
    return {k: share for k, share in enumerate(shares) if share >= _MOSTLY and share == worst}


def silent_electrodes(values: Array, model: Array, pairs: Index, count: int) -> list[int]:
    """Electrodes, from 0, whose readings (m,) off driven electrodes are together less than a tenth, 2-norms, of what a
    model (m,) makes of them, over what the median electrode's are of theirs; pairs (m, 4)."""
    off = np.isfinite(values) & np.isfinite(model) & ~(pairs[:, :2, None] == pairs[:, None, 2:]).any(axis=(1, 2))
    uses = [off & (pairs[:, 2:] == k).any(axis=1) for k in range(count)]
    size = np.array([[np.linalg.norm(of[use]) for use in uses] for of in (values, model)])
    share = np.divide(*size, out=np.full(count, np.nan), where=size[1] > 0)
    return np.flatnonzero(share < _SILENT * np.nanmedian(share)).tolist() if size[1].any() else []


def mean_frame(frames: Array) -> Array:
    """(readings,) mean over the frames (frames, readings) in which each reading is there; NaN where it never is."""
    there = np.isfinite(frames).sum(axis=0)
    return np.divide(np.nansum(frames, axis=0), there, out=np.full(frames.shape[1], np.nan), where=there > 0)


def repeats(values: Array, pairs: Index, current: Array, *, signed: bool) -> Apart | None:
    """Patterns that a frame drives twice, values (frames, readings) by pairs (readings, 4) and currents (readings,);
    None without any."""
    patterns = list(_patterns(values, pairs, current))
    return _compared([(one, other, 1) for k, one in enumerate(patterns) for other in patterns[k + 1:]
                      if (one.source, one.sink) == (other.source, other.sink)], signed)


def source_against_sink(values: Array, pairs: Index, current: Array, *, signed: bool) -> Apart | None:
    """Patterns with source and sink exchanged, likewise; None without any."""
    patterns = list(_patterns(values, pairs, current))
    return _compared([(one, other, -1) for k, one in enumerate(patterns) for other in patterns[k + 1:]
                      if (one.source, one.sink) == (other.sink, other.source)], signed)


def reciprocity(values: Array, pairs: Index, current: Array, *, signed: bool) -> Apart | None:
    """Readings with drive and measurement exchanged, likewise, all in one comparison; None without any."""
    scaled = values / current
    place = {tuple(row): k for k, row in enumerate(pairs.tolist())}
    found = []
    for k, (source, sink, plus, minus) in enumerate(pairs.tolist()):
        for sign, key in ((1, (plus, minus, source, sink)), (1, (minus, plus, sink, source)),
                          (-1, (minus, plus, source, sink)), (-1, (plus, minus, sink, source))):
            if (other := place.get(key, k)) > k:
                found.append((k, other, sign))
    if not found:
        return None
    one, other, sign = np.array(found).T
    apart = _apart(scaled[:, one], scaled[:, other] * sign, signed)
    return Apart(apart, apart, apart, apart, len(found))


def _patterns(values: Array, pairs: Index, current: Array) -> Iterator[_Pattern]:
    ends = np.flatnonzero(np.any(np.diff(pairs[:, :2], axis=0) != 0, axis=1)) + 1
    for rows in np.split(np.arange(len(pairs)), ends):
        yield _Pattern(int(pairs[rows[0], 0]), int(pairs[rows[0], 1]), pairs[rows, 2:], values[:, rows] / current[rows])


def _compared(matches: list[tuple[_Pattern, _Pattern, int]], signed: bool) -> Apart | None:
    lists = []
    for one, other, sign in matches:
        place = {tuple(row): k for k, row in enumerate(other.ends.tolist())}
        both = [(k, place[tuple(row)]) for k, row in enumerate(one.ends.tolist()) if tuple(row) in place]
        if both:
            here, there = np.array(both).T
            a, b = one.values[:, here], sign * other.values[:, there]
            whole = signed and np.isfinite(a).all() and np.isfinite(b).all()
            voltages = _electrode_voltages(one.ends[here]) if whole else None
            lists.append((a, b) if voltages is None else (a @ voltages, b @ voltages))
    if not lists:
        return None
    found = [_apart(a, b, signed) for a, b in lists]
    one, other = (np.concatenate([each[k].ravel() for each in lists]) for k in (0, 1))
    together = _apart(one, other, signed)
    return Apart(min(found), float(np.median(found)), max(found), together, len(found))


def _electrode_voltages(ends: Index) -> Array | None:
    """(n, electrodes) matrix that makes readings of these pairs the electrodes' voltages, mean 0; None where the pairs
    do not link all electrodes that they name."""
    names, index = np.unique(ends, return_inverse=True)
    index = index.reshape(ends.shape)
    weights = np.eye(len(names))[index[:, 0]] - np.eye(len(names))[index[:, 1]]
    if np.linalg.matrix_rank(weights) < len(names) - 1:
        return None
    return np.asarray(np.linalg.pinv(weights).T, dtype=float)


def _apart(one: Array, other: Array, signed: bool) -> float:
    if not signed:
        one, other = np.abs(one), np.abs(other)
    kept = np.isfinite(one) & np.isfinite(other)
    size = np.linalg.norm(one[kept])
    return float(np.linalg.norm((one - other)[kept]) / size) if size else 0.0
