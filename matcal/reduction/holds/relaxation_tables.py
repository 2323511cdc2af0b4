"""Tables of a relaxation: strain and stress over time, or a modulus over the time since its step of strain.

Times are counted from the start of loading. A table whose strain is held from its first row has no ramp: it is a step.
Times above zero in its first row are the times since that step, as in a table of G(t), unless the stress falls faster
there than any material does so long after a step: then they are a clock's, and the step is at the first row.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from matcal.readers.recording import Recording
from matcal.readers.vocabulary import quantity_of
from matcal.reduction.experiment import Experiment
from matcal.reduction.hold_segments import held_samples, held_throughout, loading_start
from matcal.reduction.stroke_segments import find_stroke
from matcal.reduction.tables.modulus_symbol import symbol_of
from matcal.reduction.tables.reduced_tables import reduce_table
from touchcal.arrays import Array
from touchcal.errors import InputFileError

# relaxation times that are compared, in each decade; ln of the share by which one of them may have fallen before the
# first row; relative misfit that no table distinguishes; difference of twice the log likelihood that decides
_AT_ITS_PEAK = 0.9  # share of its largest that a force has in its first row where no ramp was recorded
_PER_DECADE, _FALLEN, _FINEST, _CLEAR = 10, np.log(1e3), 1e-3, 10.0


def reduce_relaxation_table(recording: Recording, direction: str | None = None) -> Experiment:
    """The table, its clock counted from the start of loading; rows at rest before it left out. InputFileError as
    that of `matcal.reduction.tables.reduced_tables.reduce_table`."""
    is_modulus = bool({"modulus", "normalised"} & set(recording.columns)) and "stress" not in recording.columns
    found = _of_modulus(recording) if is_modulus else reduce_table("relaxation", recording, direction)
    if is_modulus or held_throughout(found.strain):
        return _as_step(found, recording)
    start = loading_start(found.strain)
    if held_throughout(found.strain[start + 1:]):
        return _as_step(_held_rows(found, start), recording)
    return _from_row(found, start)


def as_held(recording: Recording) -> Recording | None:
    """A record of force over time whose displacement is missing or never moves, and whose force only falls from its
    first rows on, as a normalised modulus over the time since a step; None for any other record."""
    has, force = recording.columns, recording.columns.get("force")
    if force is None or "time" not in has or {"strain", "stretch", "stress"} & set(has):
        return None
    load = force * np.sign(np.median(force))
    if load[0] < _AT_ITS_PEAK * load.max() or load.min() <= 0 or _moves(has.get("displacement")):
        return None
    said = (f"No ramp was recorded: column '{recording.names['force']}' over its first value, since a step there.",)
    return replace(recording, columns={"time": has["time"], "normalised": load / load[0]},
                   names={"time": recording.names["time"], "normalised": recording.names["force"]},
                   units={"time": recording.units["time"], "normalised": "-"}, notes=(*recording.notes, *said))


def _moves(displacement: Array | None) -> bool:
    if displacement is None:
        return False
    try:
        find_stroke(displacement)
    except ValueError:
        return False
    return True


def _held_rows(found: Experiment, rest: int) -> Experiment:
    """The rows after the last at rest, where all are held: a step at an unknown time between both, counted from the
    row at rest."""
    assert found.time_s is not None
    rows = {name: column[rest + 1:] for name in ("strain", "value", "deviation")
            if (column := getattr(found, name)) is not None}
    return replace(found, **rows, time_s=found.time_s[rest + 1:] - found.time_s[rest], decisions=(
        *found.decisions, f"{rest + 1} rows at rest before the step left out; no row of its ramp was recorded."))


def _of_modulus(recording: Recording) -> Experiment:
    """A modulus as the stress of a unit step; its strain is 0, that of small strains."""
    name = "modulus" if "modulus" in recording.columns else "normalised"
    if "time" not in recording.columns:
        raise _error(recording, f"a table of a relaxing modulus needs a time column; found: "
                                f"{', '.join(recording.names.values())}.")
    time, value = recording.columns["time"], recording.columns[name]
    if time.size < 5:
        raise _error(recording, f"{time.size} rows are no relaxation. A fit needs at least five.")
    if np.any(np.diff(time) <= 0):
        raise _error(recording, "the time does not grow from row to row, so it is no history. Sort the rows.")
    if value.min() <= 0:
        raise _error(recording, f"column '{recording.names[name]}' falls to {value.min():.4g}, and a modulus is above "
                                "0. Are two columns exchanged?")
    own = recording.names[name]
    said = (f"Column '{own}' over the time since a step of strain: no strain is needed.",)
    return Experiment("relaxation", np.zeros(time.size), value, time, tuple(p.name for p in recording.paths),
                      facts={symbol_of(own) if name == "modulus" else "table_normalised": 1.0},
                      decisions=(*recording.notes, *said))


def _as_step(found: Experiment, recording: Recording) -> Experiment:
    """The table with its times counted from the step."""
    time = found.time_s
    assert time is not None
    first = float(time[0])
    if first <= 0 or not since_step(time, np.abs(found.value)):
        at = f" (its clock reads {first:.6g} s there)" if first else ""
        facts = {**found.facts, "step_first_s": 0.0, **({"step_clock_s": first} if first > 0 else {})}
        if not {"modulus", "normalised"} & set(recording.columns) or quantity_of(recording.names.get("normalised", "")):
            facts["step_recorded"] = 1.0  # what a machine held, after a ramp that is not there
        return replace(found, time_s=time - first, held=np.ones(time.size), facts=facts, decisions=(
            *found.decisions, f"The strain is held from the first row on: a step at that row{at}."))
    return replace(found, held=np.ones(time.size), facts={**found.facts, "step_first_s": first}, decisions=(
        *found.decisions, f"The strain is held from the first row on: a step at 0 s, seen from {first:.4g} s on."))


def since_step(time: Array, value: Array) -> bool:
    """Whether values (n,) at times (n,) above 0 can be those of a relaxation since a step at 0: sums of decaying
    exponentials, none of which had fallen a thousandfold before the first time, follow them no worse than sums with
    faster ones, which a step at the first row would allow."""
    after, span = time - time[0], float(time[-1])
    low, high = np.log10(min(float(np.min(np.diff(time))), time[0] / _FALLEN)), np.log10(10 * span)
    tau = np.logspace(low, high, int(_PER_DECADE * (high - low)) + 2)
    columns = np.column_stack([np.ones(time.size), np.exp(-after[:, None] / tau)])
    slow = np.r_[True, tau >= time[0] / _FALLEN]
    misses = [nnls(part, value)[1] / np.linalg.norm(value) for part in (columns[:, slow], columns)]
    return 2 * time.size * np.log(max(misses[0], _FINEST) / max(misses[1], _FINEST)) < _CLEAR


def _from_row(found: Experiment, start: int) -> Experiment:
    """The rows from `start` on, times counted from there."""
    time = found.time_s
    assert time is not None
    rows = {name: column[start:] for name in ("strain", "value", "deviation")
            if (column := getattr(found, name)) is not None}
    since = time[start:] - time[start]
    said = (f"{start} rows at rest before the ramp left out.",) if start else ()
    return replace(found, **rows, time_s=since, held=held_samples(since, rows["strain"]),
                   decisions=(*found.decisions, *said))


def _error(recording: Recording, problem: str) -> InputFileError:
    return InputFileError(recording.paths[0], problem, line=recording.first_line)
