"""A fast ramp and a hold, or several: relaxation in compression (ISO 3384-1)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.experiment import Experiment
from matcal.reduction.hold_segments import find_holds
from matcal.reduction.load_cycles import Loading
from matcal.reduction.load_frame import correct
from matcal.reduction.specimen import Block
from matcal.statistics.block_means import Edges, block_means, log_blocks
from touchcal.arrays import Array
from touchcal.errors import InputFileError

# points left of each hold and, at most, of each ramp, and the strain below which the toe is not the material's
_POINTS, _RAMP, _TOE_STRAIN = 120, 300, 0.01


def reduce_relaxation(recording: Recording, block: Block) -> Experiment:
    """Nominal stress against time of ramps and holds, with the strain history that belongs to it; `held` marks the
    holds.

    A ramp keeps its samples (means of them above 300): its stress is far from linear in time for a foam that
    densifies, so a fit should convolve the whole history rather than assume a step or a linear ramp. Each hold is
    thinned to means of blocks equal in the log of the time since it began, `samples` says of how many. Raises
    InputFileError as `matcal.reduction.load_frame.correct`, and where there is no clock or no hold.
    """
    record = correct("relaxation", recording, block)
    path, time = recording.paths[0], record.time_s
    if time is None:
        raise InputFileError(path, f"a relaxation needs a time column; found: {', '.join(recording.names.values())}.")
    spans = _holds(record, time, path)
    toe = int(np.argmax(np.abs(record.strain) >= _TOE_STRAIN))
    edges, held = _edges(time, spans, toe)
    t, e, p = (np.concatenate([[0.0], block_means(x, edges)]) for x in (time, record.strain, record.stress_Pa))
    facts = {**record.facts, **_facts(record, time, spans)}
    return Experiment(kind="relaxation", strain=e, value=p, time_s=t, samples=np.concatenate([[1.0], np.diff(edges)]),
                      held=np.concatenate([[0.0], held]), noise=record.noise_Pa,
                      source=tuple(p.name for p in recording.paths), facts=facts,
                      decisions=record.decisions + _sentences(facts, len(spans), t.size), cautions=record.cautions)


def _holds(record: Loading, time: Array, path: Path) -> list[tuple[int, int]]:
    """The holds at least as long as the ramp before each; the one at the largest strain begins where the loading ends.
    InputFileError where there is none."""
    spans = find_holds(time, np.abs(record.strain))
    spans = [(record.end if abs(first - record.end) < 0.05 * (last - first) else first, last) for first, last in spans]
    times = [(float(time[last - 1] - time[first]), float(time[first]) - begin)
             for (first, last), begin in zip(spans, _begins(time, spans), strict=True)]
    kept = [span for span, (held, ramp) in zip(spans, times, strict=True) if held >= ramp]
    if not kept:
        held, ramp = max(times, default=(float(time[-1] - time[record.end]), float(time[record.end])))
        of = f", the longest of {len(times)}," if len(times) > 1 else ""
        raise InputFileError(path, f"it holds{of} for {held:.3g} s after a ramp of {ramp:.3g} s, so there is no hold "
                                   "to fit: one lasts as long as its ramp. Give the whole test.")
    return kept


def _begins(time: Array, spans: Sequence[tuple[int, int]]) -> list[float]:
    """When the ramp before each hold begins: at contact, or at the end of the hold before, s."""
    return [0.0, *(float(time[last - 1]) for _, last in spans)][:len(spans)]


def _edges(time: Array, spans: Sequence[tuple[int, int]], toe: int) -> tuple[Edges, Array]:
    """Edges of the blocks from the toe to the end of the last hold, and for each block 1 in a hold, 0 on a ramp."""
    edges, held, at = [toe], [], toe
    for first, last in spans:
        ramp = np.unique(np.linspace(at, first, min(max(first - at, 0), _RAMP) + 1).round().astype(int))[1:]
        hold = first + log_blocks(time[first:last], _POINTS)[1:]
        edges += [*ramp.tolist(), *hold.tolist()]
        held += [0.0] * ramp.size + [1.0] * hold.size
        at = last
    return np.array(edges), np.array(held)


def _facts(record: Loading, time: Array, spans: Sequence[tuple[int, int]]) -> dict[str, float]:
    """Times, strain and relaxed share of the holds: of the first without a number, of all with one where there are
    several."""
    out = {"holds": float(len(spans))}
    for k, ((first, last), begin) in enumerate(zip(spans, _begins(time, spans), strict=True)):
        few = max(1, min(5, (last - first) // 10))
        hold, stress = record.strain[first:last], record.stress_Pa[first:last]
        found = {"ramp_s": float(time[first]) - begin, "hold_s": float(time[last - 1] - time[first]),
                 "hold_strain": float(hold.mean()), "hold_strain_change": float(hold[-1] - hold[0]),
                 "hold_relaxed": 1 - float(stress[-few:].mean() / stress[:few].mean())}
        out |= found if k == 0 else {}
        out |= {f"{name}_{k + 1}": value for name, value in found.items()} if len(spans) > 1 else {}
    return out


def _sentences(facts: Mapping[str, float], holds: int, points: int) -> tuple[str, ...]:
    out = [f"{holds} hold{'s' if holds > 1 else ''}, ramps kept sample by sample (at most {_RAMP} points) from a "
           f"strain of {_TOE_STRAIN:.0%}, holds thinned to means equal in log time, the state of rest put first: "
           f"{points} points."]
    for k in range(1, holds + 1):
        end = f"_{k}" if holds > 1 else ""
        out.append(f"Hold {k}: ramp of {facts['ramp_s' + end]:.3f} s, held {facts['hold_s' + end]:.1f} s at a strain "
                   f"of {facts['hold_strain' + end]:.4f} that changes by {facts['hold_strain_change' + end]:.1g}; the "
                   f"stress falls by {facts['hold_relaxed' + end]:.0%}.")
    return tuple(out)
