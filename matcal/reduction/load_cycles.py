"""Loadings of a cyclic test: one of them kept, loss and set of all of them reported."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from matcal.reduction.experiment import CROSSED_S, StrainPath
from matcal.statistics.block_means import block_means
from touchcal.arrays import Array

BRANCHES = ("last", "first", "all")  # which loading of a cyclic test is used; all: first loadings, and the whole path
_SMOOTH = 10  # samples that are averaged to see where the stress passes zero
_UNLOADED = 0.7  # share of its largest strain below which a specimen counts as unloaded
_PATH = 60  # points of the whole path between two turns
_START, _FEWEST = 0.03, 8  # strains of a later loading above zero stress that show its start, fewest samples there


@dataclass(frozen=True)
class Loading:
    """The corrected record from contact on, signs as in `Experiment`."""

    time_s: Array | None  # (n,) time since contact, s; None where the file has no clock
    strain: Array  # (n,) nominal strain, compression negative
    stress_Pa: Array  # (n,) nominal stress, Pa, compression negative
    end: int  # index of the first sample at the end of the loading
    noise_Pa: float  # standard deviation of the noise of one sample of stress, Pa
    decisions: tuple[str, ...]  # sentences of the reduction
    facts: Mapping[str, float]  # its numbers
    # one row a cycle where the test has several: cycle, peak_stress_Pa, loss_Pa, residual_strain; else None
    cycles: Mapping[str, Array] | None = None
    cautions: tuple[str, ...] = ()  # what is to be minded of it
    from_rest: bool = True  # whether it begins without stress
    path: StrainPath | None = None  # loading and unloading of every cycle, where it is all used


def one_loading(record: Loading, spans: Sequence[tuple[int, int]], branch: str, length_m: float) -> Loading:
    """The first or the last loading of a record, `spans` being (first sample, end) of each; the record itself where
    there is one loading, with the loss of its cycle where it unloads.

    The last loading counts its strain from where it begins to carry load, over the original length, and its time from
    there: it is taken to start at rest, without the earlier cycles' history.
    """
    cycles = _cycles(record, spans)
    facts = {**record.facts, "loadings": float(len(spans)), **_last_of(cycles)}
    if record.time_s is not None and len(spans) > 1 and branch != "all":
        facts["loading_s"] = float(record.time_s[spans[-1][1]] - record.time_s[spans[-1][0]])
    if branch == "all":
        return _first_loadings(replace(record, cycles=cycles, facts=facts), spans)
    if len(spans) == 1 or branch == "first":
        said = (f"The first of {len(spans)} loadings is used, the specimen not preconditioned, as asked for.",)
        return replace(record, cycles=cycles if len(spans) > 1 else None, facts=facts,
                       decisions=record.decisions + (said if len(spans) > 1 else ()) + _sentences(cycles))
    begin, end = spans[-1]
    start = _zero_crossing(record, begin, end)
    side = 1.0 if record.strain[record.end] > 0 else -1.0
    chosen = (f"The last of {len(spans)} loadings is used, the ones before being its preconditioning (--branch first "
              "takes the first). ")
    if start is None:
        said = (f"{chosen}The stress does not return to zero before it, so its strain is counted from the first "
                "contact and its clock is left out: no rate correction is possible.")
        if record.time_s is not None:
            facts |= {"clock_left_out_s": float(record.time_s[end] - record.time_s[begin])}
        return replace(record, time_s=None, strain=record.strain[begin:end + 1], end=end - begin, cycles=cycles,
                       stress_Pa=record.stress_Pa[begin:end + 1], facts=facts, from_rest=False,
                       decisions=(*record.decisions, said, *_sentences(cycles)))
    first, at = start
    facts |= {"residual_strain": side * at}
    said = (f"{chosen}It begins to carry load at a strain of {side * at:.4f}, the set that is left; its strain is "
            f"counted from there, over the original length of {length_m * 1e3:.4g} mm, and its history from there as "
            "from rest: what the cycles before left unrelaxed is not corrected for.")
    time = None if record.time_s is None else record.time_s[first:end + 1] - record.time_s[first]
    return replace(record, time_s=time, strain=record.strain[first:end + 1] - side * at,
                   stress_Pa=record.stress_Pa[first:end + 1], end=end - first, cycles=cycles, facts=facts,
                   decisions=(*record.decisions, said, *_sentences(cycles)))


def _first_loadings(record: Loading, spans: Sequence[tuple[int, int]]) -> Loading:
    """The samples of loadings that no sample before reached, and the whole path, thinned between its turns."""
    side = 1.0 if record.strain[record.end] > 0 else -1.0
    reached, parts = -np.inf, []
    for begin, end in spans:
        own = np.arange(begin, end + 1)
        parts.append(own[side * record.strain[own] > reached])
        reached = max(reached, float((side * record.strain[own]).max()))
    first = np.concatenate(parts)
    pieces = sum(p.size > 0 for p in parts)
    turns = np.unique([0, *(n for begin, end in spans for n in (begin, end + 1)), record.strain.size])
    edges = np.unique(np.concatenate([np.linspace(a, b, min(b - a, _PATH) + 1).round().astype(int)
                                      for a, b in pairwise(turns.tolist())]))
    path = StrainPath(block_means(record.strain, edges), block_means(record.stress_Pa, edges),
                      None if record.time_s is None else block_means(record.time_s, edges),
                      record.noise_Pa / np.sqrt(float(np.median(np.diff(edges)))))
    crossed = record.time_s is not None and pieces > 1 and path.crosses
    time = None if record.time_s is None or crossed else record.time_s[first]
    facts = {**record.facts, CROSSED_S: float(np.ptp(record.time_s[spans[0][0]:spans[0][1] + 1]))
             } if record.time_s is not None and crossed else record.facts
    said = (f"The parts of {len(spans)} loadings that go further than those before are the first loading, "
            f"{first.size} samples; {path.strain.size} points of the whole path show what unloading softens."
            + (" They are not corrected for rate, since the path crosses from tension to compression." if crossed else
               " They are not corrected for rate: there is no clock." if pieces > 1 and record.time_s is None else ""))
    return replace(record, time_s=time, strain=record.strain[first], stress_Pa=record.stress_Pa[first],
                   end=first.size - 1, path=path, facts=facts, decisions=(*record.decisions, said))


def _zero_crossing(record: Loading, begin: int, end: int) -> tuple[int, float] | None:
    """(sample, size of the strain) where a loading begins to carry load: its stress, a parabola above its noise, at
    zero; None where it starts loaded."""
    side = 1.0 if record.strain[record.end] > 0 else -1.0
    e, p = side * record.strain[begin:end + 1], side * record.stress_Pa[begin:end + 1]
    size = max(1, min(_SMOOTH, e.size // 50))
    edges = np.arange(0, e.size + 1, size)
    mean = block_means(p, edges)
    clear = 4 * record.noise_Pa / np.sqrt(size) + 1e-3 * float(p.max())
    below = np.flatnonzero(mean < clear)
    if not below.size or below[0] > 0.5 * mean.size or (mean[0] >= clear and below[0] > 3):
        return None
    above = int(edges[int(np.argmax((mean >= clear) & (np.arange(mean.size) > below[0])))])
    used = (np.arange(e.size) >= above) & (e < e[above] + _START)
    if np.count_nonzero(used) < _FEWEST:
        return begin + above, float(e[above])
    curve = np.polynomial.Polynomial.fit(e[used], p[used], 2)
    roots = np.real(curve.roots()[np.isreal(curve.roots())])
    near = roots[(roots > e[0] - 1e-9) & (roots <= e[above])]
    at = float(near.max()) if near.size else float(e[above])
    return begin + int(np.argmax(e >= at)), at


def _cycles(record: Loading, spans: Sequence[tuple[int, int]]) -> dict[str, Array] | None:
    """Peak stress, loss (area of the loop, Pa = J/m3) and residual strain of every loading that is unloaded again."""
    rows = []
    side = 1.0 if record.strain[record.end] > 0 else -1.0
    for k, (begin, end) in enumerate(spans):
        until = spans[k + 1][0] if k + 1 < len(spans) else record.strain.size
        e, p = side * record.strain[begin:until], side * record.stress_Pa[begin:until]
        if e.size < 3 or e[-1] > _UNLOADED * e.max():
            continue
        pressed = np.clip(p, 0.0, None)  # a cycle that goes on through zero loads the other side
        work_in = float(np.trapezoid(pressed[:end - begin + 1], e[:end - begin + 1]))
        returned = -float(np.trapezoid(pressed[end - begin:], e[end - begin:]))
        falling = e[end - begin:][p[end - begin:] <= 4 * record.noise_Pa]
        rows.append((k + 1.0, side * float(p[:end - begin + 1].max()), work_in - returned, work_in,
                     side * float(np.clip(falling[0] if falling.size else e[-1], 0.0, None))))
    if not rows:
        return None
    names = ("cycle", "peak_stress_Pa", "loss_Pa", "work_Pa", "residual_strain")
    return dict(zip(names, np.array(rows).T, strict=True))


def _last_of(cycles: Mapping[str, Array] | None) -> dict[str, float]:
    if cycles is None:
        return {}
    return {"loss_J_per_m3": float(cycles["loss_Pa"][-1]),
            "loss_share": float(cycles["loss_Pa"][-1] / cycles["work_Pa"][-1]) if cycles["work_Pa"][-1] > 0 else 0.0}


def _sentences(cycles: Mapping[str, Array] | None) -> tuple[str, ...]:
    if cycles is None:
        return ()
    share = np.divide(cycles["loss_Pa"], cycles["work_Pa"], out=np.zeros_like(cycles["loss_Pa"]),
                      where=cycles["work_Pa"] > 0)
    rows = ", ".join(f"{loss / 1e3:.3g} kJ/m3 ({part:.0%})" for loss, part in
                     zip(cycles["loss_Pa"], share, strict=True))
    return (f"Work lost in each cycle, with its share of the work put in: {rows}; unloading meets zero stress at a "
            f"strain of {', '.join(f'{e:.3f}' for e in cycles['residual_strain'])}.",)
