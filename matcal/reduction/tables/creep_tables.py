"""Tables of a creep: compliance over the time since a step of stress, or strain under a stress that is held."""

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.experiment import Experiment
from matcal.reduction.tables.modulus_symbol import symbol_of
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.number_words import percent

_LINEAR = 0.05  # strain from which on a compliance is no longer that of small strains
_HELD = 0.05  # share of its level by which a held stress varies at most, noise and all
_FEWEST = 5


def reduce_creep(recording: Recording) -> Experiment:
    """Compliance, 1/Pa, over the time since the step, from its column or as strain over the held stress."""
    columns, names = recording.columns, recording.names
    if "time" not in columns:
        raise _error(recording, f"a creep needs a time column; found: {', '.join(names.values())}.")
    time, notes, cautions = columns["time"], list(recording.notes), list[str]()
    facts: dict[str, float] = {}
    if "compliance" in columns:
        value, facts = columns["compliance"], {symbol_of(names["compliance"]): 1.0}
        notes.append(f"Column '{names['compliance']}' over the time since a step of stress.")
    else:
        time, strain, stress = _held(recording)
        value = strain / float(np.mean(stress))
        sheared = names.get("strain", "").lower().startswith(("gamma", "γ", "shear"))
        facts = {"table_of_G" if sheared else "table_of_E": 1.0}
        notes.append(f"A stress of {np.mean(stress):.4g} Pa is held from the row at {time[0]:.4g} s on: compliance = "
                     "strain / stress.")
        if (reach := float(np.abs(strain).max())) > _LINEAR:
            cautions.append(f"{recording.label} creeps to a strain of {percent(reach, 2)}: its compliance is taken as "
                            "that of small strains, and the series is that of this stress.")
    if value.size < _FEWEST:
        raise _error(recording, f"{value.size} rows are no creep. A fit needs at least five.")
    if np.any(np.diff(time) <= 0) or value.min() <= 0:
        raise _error(recording, "a creep has a growing time and a compliance above 0. Sort the rows, and check that no "
                                "columns are exchanged.")
    return Experiment("creep", np.zeros(time.size), value, time, tuple(p.name for p in recording.paths),
                      facts=facts, decisions=tuple(notes), cautions=tuple(cautions))


def _held(recording: Recording) -> tuple[Array, Array, Array]:
    """Time, strain and stress of the rows in which the stress is held, counted from the row before."""
    columns = recording.columns
    if not {"strain", "stretch"} & set(columns) or "stress" not in columns:
        raise _error(recording, "a creep needs a compliance, or strain and stress; found: "
                                f"{', '.join(recording.names.values())}. Divide displacement by the specimen's height "
                                "and force by its area.")
    time, stress = columns["time"], columns["stress"]
    strain = columns["strain"] if "strain" in columns else columns["stretch"] - 1
    level = float(np.median(stress[stress.size // 2:]))
    first = int(np.argmax(np.abs(stress - level) <= _HELD * abs(level)))
    low, high = np.quantile(stress[first:], (0.05, 0.95))
    if not level or high - low > 2 * _HELD * abs(level):
        raise _error(recording, "no stress is held. Give a relaxation, or the part in which the stress is constant.")
    begin = float(time[first - 1]) if first else 0.0
    return time[first:] - begin, strain[first:], stress[first:]


def _error(recording: Recording, problem: str) -> InputFileError:
    return InputFileError(recording.paths[0], problem, line=recording.first_line)
