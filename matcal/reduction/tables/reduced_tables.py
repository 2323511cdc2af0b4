"""Tables that are reduced already: strain with nominal stress, J with pressure, or strain with conductivity."""

import re
from dataclasses import replace

import numpy as np

from matcal.readers.recording import Recording
from matcal.readers.vocabulary import quantity_of
from matcal.reduction.experiment import Experiment
from matcal.reduction.loading_direction import densifies, named_direction, words_about
from matcal.reduction.loading_doubts import collapse, collapse_sentence, hold_doubts, loading_doubts
from matcal.reduction.tables.strain_zero import zero_of
from touchcal.arrays import Array
from touchcal.errors import InputFileError

_SIGNED = 0.02  # share of the largest strain, below 0, from which on a table counts compression as negative
_LARGEST_STRAIN = 20.0  # a strain above this is another quantity, or in another unit
# standard deviation of the zero of a table's strain where the table leaves it open, and share of its reach at most;
# standard errors from which on an error is said, and error up to which a zero is known
_ZERO, _ZERO_SHARE, _CLEAR, _SMALL = 0.003, 0.01, 2.5, 3e-4
_FAR = 1e-3  # error of a zero from which on it is said
# standard deviation of the zero of a table's load, share of the largest: a cell of class 1 of ISO 7500-1, whose zero is
# within 0.1 % of its range, of which the test takes a twentieth
_LOAD_ZERO = 0.02
_FREE_FACES = ("uniaxial", "planar", "biaxial")


def reduce_table(kind: str, recording: Recording, direction: str | None = None, *, cycled: bool = False) -> Experiment:
    """The table as it stands, stretch turned into strain, pressure into mean stress, compression made negative;
    `direction` is what the specimen's file says of it; `cycled`: whether its unloading is used. InputFileError where a
    column is missing or constant, signs disagree, or a number cannot be what its column says."""
    notes, cautions = list(recording.notes), list[str]()
    one_loading = kind in (*_FREE_FACES, "shear") and not cycled
    if one_loading:
        recording = _until_collapse(recording, cautions)
    strain, value = (_volumetric if kind == "volumetric" else _strain_and_value)(kind, recording, notes)
    _check(kind, recording, strain, value)
    if kind in (*_FREE_FACES, "relaxation", "conductivity"):
        strain, value = _compression_negative(kind, recording, strain, value, direction, notes, cautions)
    _check_range(kind, recording, strain, direction)
    if one_loading:
        cautions += loading_doubts(recording.label, strain, value)
        most = int(np.argmax(np.abs(strain))) + 1
        time = recording.columns.get("time")
        cautions += hold_doubts(recording.label, None if time is None else time[:most], strain[:most], value[:most])
    time = recording.columns.get("time")
    if time is not None and np.any(np.diff(time) <= 0):
        raise _error(recording, "the time does not grow from row to row, so it is no history. Leave the column out.")
    if time is not None and kind != "relaxation":
        time = time - time[0]
    deviation = _deviation(recording) if kind != "conductivity" else None
    lateral = _lateral(recording, strain, notes) if kind in _FREE_FACES else None
    facts = _zero(kind, recording.label, strain, value, cautions) if (
        one_loading and lateral is None) else {}
    if kind == "relaxation" and "strain" in recording.columns and not _named(recording, direction) \
            and strain.min() >= -_SIGNED * np.abs(strain).max():
        facts["direction_assumed"] = 1.0  # of consequence only next to a law: shares that relax have no sign
    return Experiment(kind=kind, strain=strain, value=value, time_s=time, deviation=deviation,
                      lateral=lateral, source=tuple(p.name for p in recording.paths), decisions=tuple(notes),
                      cautions=tuple(cautions), facts=facts)


def _until_collapse(recording: Recording, cautions: list[str]) -> Recording:
    """The rows up to the largest stress on the side of the largest strain, where it falls to nothing afterwards while
    the strain still grows. A table may begin on the other side, in compression of a table of tension."""
    columns = recording.columns
    strain = columns.get("strain", columns["stretch"] - 1 if "stretch" in columns else None)
    if strain is None or "stress" not in columns:
        return recording
    most = int(np.argmax(np.abs(strain)))
    side = np.sign(strain[most])
    other = np.flatnonzero(side * strain[:most + 1] < 0)
    begin = int(other[-1]) + 1 if other.size else 0
    stress = columns["stress"][begin:most + 1]
    turned = np.sign(stress[int(np.argmax(np.abs(stress)))])
    found = collapse(side * strain[begin:most + 1], turned * stress)
    if found is None:
        return recording
    top = begin + found
    cautions.append(collapse_sentence(recording.label, f"a strain of {strain[top]:.3g}", f"{strain[most]:.3g}"))
    return replace(recording, columns={q: column[:top + 1] for q, column in columns.items()})


def _strain_and_value(kind: str, recording: Recording, notes: list[str]) -> tuple[Array, Array]:
    columns = dict(recording.columns)
    if "strain" not in columns and "stretch" in columns:
        if kind == "shear":
            raise _error(recording, f"a shear test is given by gamma, and column '{recording.names['stretch']}', "
                                    f"{columns['stretch'].min():g} to {columns['stretch'].max():g}, may be a stretch. "
                                    "Name the column gamma.")
        columns["strain"] = columns["stretch"] - 1
        notes.append(f"Column '{recording.names['stretch']}' is the stretch: strain = stretch - 1.")
    elif kind == "shear" and quantity_of(name := recording.names.get("strain", "")) == "stretch":
        notes.append(f"Column '{name}' runs through 0, which no stretch does: in this shear test it is gamma.")
    requested = {"conductivity": ("strain", "conductivity"), "relaxation": ("strain", "stress", "time")}
    if missing := [q for q in requested.get(kind, ("strain", "stress")) if q not in columns]:
        raise _missing(kind, recording, missing[0])
    return columns["strain"], columns["conductivity" if kind == "conductivity" else "stress"]


def _volumetric(kind: str, recording: Recording, notes: list[str]) -> tuple[Array, Array]:
    """J and mean stress (minus the pressure)."""
    columns, names = recording.columns, recording.names
    if "volume_ratio" in columns:
        ratio = columns["volume_ratio"]
    elif "strain" in columns and re.search(r"vol", names["strain"].lower()):
        ratio = 1 + columns["strain"]
        notes.append(f"Column '{names['strain']}' is the change of volume over the volume: J = 1 + it.")
    else:
        raise _missing(kind, recording, "volume ratio (J)")
    if "pressure" not in columns and "stress" not in columns:
        raise _missing(kind, recording, "pressure")
    name = "pressure" if "pressure" in columns else "stress"
    mean = -columns["pressure"] if name == "pressure" else columns["stress"]
    if float((ratio - 1) @ mean) < 0:
        mean = -mean
        said = "negative in compression" if name == "pressure" else "positive in compression"
        notes.append(f"Column '{names[name]}' is {said}: its sign is turned so that mean stress and J - 1 agree.")
    notes.append("The stress of a volumetric test is the mean Cauchy stress, minus the pressure.")
    return ratio, mean


def _check(kind: str, recording: Recording, strain: Array, value: Array) -> None:
    what = {"shear": "gamma", "volumetric": "J"}.get(kind, "strain")
    if strain.size < 3:
        raise _error(recording, f"{strain.size} rows are no curve. A fit needs at least three.")
    if np.ptp(strain) == 0 and kind != "relaxation":
        raise _error(recording, f"{what} is {strain[0]:g} in every row. Give the whole test, or choose another column.")
    if not np.any(value) or (kind not in ("conductivity", "relaxation") and np.ptp(value) == 0):
        raise _error(recording, f"the measured value is {value[0]:g} in every row. Choose another column.")
    rest = 1.0 if kind == "volumetric" else 0.0
    if kind not in ("conductivity",) and float((strain - rest) @ value) < 0:
        raise _error(recording, f"{what} and stress have opposite signs. Give compression as negative in both columns.")
    if kind == "conductivity" and value.min() <= 0:
        raise _error(recording, f"a conductivity of {value.min():g} S/m is not possible. Are two columns swapped?")


def _check_range(kind: str, recording: Recording, strain: Array, direction: str | None) -> None:
    what = {"shear": "gamma", "volumetric": "J"}.get(kind, "strain")
    lowest = {"shear": -np.inf, "volumetric": 0.0}.get(kind, -1.0)
    if strain.min() <= lowest or np.abs(strain).max() > _LARGEST_STRAIN:
        worst = strain[int(np.argmax(np.abs(strain)))] if strain.min() > lowest else strain.min()
        if direction == "compression" and worst <= lowest:
            raise _error(recording, f"strain = {worst:g} is not possible in compression, as the specimen's file says. "
                                    f"Write direction = \"tension\" below [{kind}] of that file, or leave it out.")
        share = "" if "strain" not in recording.names or recording.units.get("strain") == "%" else (
            f" In per cent it is given with --columns strain={recording.names['strain']}:%")
        raise _error(recording, f"{what} = {worst:g} is not possible. Are two columns swapped, or is it a percentage?"
                                f"{share}")


def _compression_negative(kind: str, recording: Recording, strain: Array, stress: Array, direction: str | None,
                          notes: list[str], cautions: list[str]) -> tuple[Array, Array]:
    """Strain and stress with compression negative; a table of compression may count it positive."""
    if strain.min() < -_SIGNED * np.abs(strain).max():
        return strain, stress
    named = _named(recording, direction)
    by = "as the specimen's file says" if direction else "by its name"
    if named == "compression":
        notes.append(f"Compression, {by}, and counted positive: the sign is turned.")
        return -strain, stress if kind == "conductivity" else -stress
    if named == "tension":
        notes.append(f"Tension, {by}.")
    elif "strain" not in recording.columns:
        notes.append("Tension, as the stretch is above 1.")
    elif kind == "conductivity" and recording.vendor == "arrays":
        notes.append("Tension, as arrays count compression as negative.")
    elif kind == "relaxation":
        notes.append("Its strain is positive and was read as tension.")
    elif kind in ("uniaxial", "conductivity"):
        shape = " Its slope falls and then rises, as that of foam does in compression." if (
            kind != "conductivity" and densifies(strain, stress)) else ""
        cautions.append(f"Nothing tells compression from tension in {recording.label}: its strain is positive and was "
                        f"read as tension.{shape} If it is compression, write compression in the name of the file or "
                        f"of a column, or direction = \"compression\" below [{kind}] of the specimen file, or make "
                        f"{'strain' if kind == 'conductivity' else 'strain and stress'} negative.")
    else:
        notes.append(f"Its strain is positive and was read as tension, as a sheet in a {kind} test is pulled.")
    return strain, stress


def _named(recording: Recording, direction: str | None) -> str | None:
    """The direction that the specimen's file, the recording's name or its columns state."""
    return direction or named_direction(words_about(recording)) or named_direction([*recording.names.values()])


def _lateral(recording: Recording, strain: Array, notes: list[str]) -> Array | None:
    """Nominal strain of the free faces, from a column of strain or of stretch."""
    name = next((q for q in ("lateral", "lateral_stretch") if q in recording.columns), None)
    if name is None:
        return None
    lateral = recording.columns[name] - (1.0 if name == "lateral_stretch" else 0.0)
    if lateral.min() <= -1:
        raise _error(recording, f"column '{recording.names[name]}': a lateral strain of {lateral.min():g} is not "
                                "possible. Is it a percentage, or a stretch?")
    notes.append(f"Column '{recording.names[name]}' is the free faces' nominal strain"
                 + (" plus 1." if name == "lateral_stretch" else "."))
    if float(strain @ lateral) > 1e-3 * float(strain @ strain):
        notes.append("The free faces move with the load, a negative Poisson's ratio; check the sign of their column.")
    return lateral


def _zero(kind: str, label: str, strain: Array, stress: Array, cautions: list[str]) -> dict[str, float]:
    """The standard deviations of the zeros of strain and load, which the fit refines like those of a load frame, where
    the noise of the table leaves them open or its curve contradicts them; that of load where it seeks one."""
    found = zero_of(kind, strain, stress)
    if found is None or max(abs(found[0]), found[1]) < _SMALL:
        return {}
    off, sd = found
    if abs(off) > max(_CLEAR * sd, _FAR):
        ahead = bool(off * strain[int(np.argmax(np.abs(strain)))] > 0)  # as a relaxation after the start leaves it
        cautions.append(f"The zero of the strain of {label} looks off{', or it relaxes as its loading begins' * ahead}"
                        f": its curve has no stress at a strain of {-off:.2g} ± {sd:.2g}. Count the strain from "
                        f"contact and the load from rest. The fit moves the zero, and the intervals hold an error of "
                        f"{_ZERO:g} of strain; for rubbers of {_LOAD_ZERO:.0%} of the largest stress too.")
    return {"strain_zero_sd": min(_ZERO, _ZERO_SHARE * float(np.abs(strain).max())), "strain_zero_assumed": 1.0,
            "zero_sd_Pa": _LOAD_ZERO * float(np.abs(stress).max())}


def _deviation(recording: Recording) -> Array | None:
    deviation = recording.columns.get("deviation")
    if deviation is not None and np.any(deviation < 0):
        raise _error(recording, f"column '{recording.names['deviation']}' is a standard deviation and falls below 0.")
    return deviation


def _missing(kind: str, recording: Recording, column: str) -> InputFileError:
    return _error(recording, f"a {kind} table needs a {column} column; found: {', '.join(recording.names.values())}.")


def _error(recording: Recording, problem: str) -> InputFileError:
    return InputFileError(recording.paths[0], problem, line=recording.first_line)
