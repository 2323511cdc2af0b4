"""Two columns that measure one thing, strain next to displacement or stress next to force: which one is used, and why.

The rule: what was measured on the specimen goes before what the frame measured. A strain that is no plain multiple of
the displacement was measured by itself and is used; one that is such a multiple is the displacement again, which is
used where the specimen's size is known and agrees. A stress next to a force likewise. Where such a multiple contradicts
the size, the user is asked.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.specimen import Block
from matcal.statistics.block_means import block_means
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.number_words import percent

_FEWEST = 30  # rows from which on strain and stress are a record, with a contact to be found, and not a table
# share of its range within which a column follows another, share by which sizes may differ, and blocks that noise is
# averaged in
_FOLLOWS, _AGREES, _BLOCKS = 5e-3, 0.01, 50
_OTHER_UNIT = 4.0  # ratio of two measures of one strain from which on one has another unit
_ON_SPECIMEN = re.compile(r"extenso|video|optic|laser|\bdic\b|\bclip|gau?ge|feindehn|ansetz|标距")


@dataclass(frozen=True)
class Measured:
    """A record in which displacement and force hold the better measure of each, and the specimen that goes with it."""

    recording: Recording  # displacement = strain x length and force = stress x area where strain and stress were chosen
    block: Block  # without the frame's compliance where the strain was measured on the specimen
    decisions: tuple[str, ...]  # what was chosen, one sentence each
    cautions: tuple[str, ...]  # what was chosen where two columns differ, and by how much


@dataclass(frozen=True)
class _Choice:
    """Whether a column that is reduced already is used in place of what the frame measured."""

    values: Array | None  # (n,) that column; None where the frame's is used
    size: float | None  # length, m, or area, m2, that belongs to it; None where nothing says it
    decisions: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()


def is_table(recording: Recording) -> bool:
    """Whether a recording of a stress-strain test holds only what is reduced already, or has too few rows of it for a
    contact to be found in."""
    has = set(recording.columns)
    if not {"displacement", "force"} & has or ("volume_ratio" in has and {"pressure", "stress"} & has):
        return True
    return _own_strain(recording) is not None and "stress" in has and recording.rows < _FEWEST


def needs_no_size(recording: Recording) -> bool:
    """Whether strain and stress stand next to displacement or force, so that the record can do without sizes."""
    return _own_strain(recording) is not None and "stress" in recording.columns


def best_measures(recording: Recording, known: Block) -> Measured:
    """The record by the better measure of strain and of stress. Sizes of 0 in `known` are not known, which
    `needs_no_size` allows. InputFileError where columns contradict the sizes."""
    columns = recording.columns
    strain = _strain_choice(recording, known.length_m)
    stress = _stress_choice(recording, known.area_m2)
    length, area = strain.size or known.length_m or 1.0, stress.size or known.area_m2 or 1.0
    chosen, names = dict(columns), dict(recording.names)
    if strain.values is not None:
        chosen["displacement"] = strain.values * length
        names["displacement"] = names.get("strain", names.get("stretch", ""))
    if stress.values is not None:
        chosen["force"], names["force"] = stress.values * area, names["stress"]
    if counted_down(columns):
        chosen |= {q: -chosen[q] for q in ("displacement", "force") if q in chosen and not _falls(chosen[q])}
    said = (*strain.decisions, *stress.decisions)
    sizes = replace(known, length_m=length, area_m2=area)
    if strain.values is not None:
        said += ("A strain measured on the specimen does not hold the frame's own give: compliance_mm_per_N is not "
                 "used.",) if sizes.compliance_m_per_N else ()
        sizes = replace(sizes, compliance_m_per_N=0.0, compliance_stated=True)
    units = {q: recording.units.get(q, "") for q in chosen}
    made = replace(recording, columns=chosen, names={q: names[q] for q in chosen}, units=units)
    return Measured(made, sizes, said, (*strain.cautions, *stress.cautions))


def counted_down(columns: Mapping[str, Array]) -> bool:
    """Whether a column counts compression as negative: strain or stress, or displacement together with force."""
    fall = {q for q, x in columns.items() if _falls(x)}
    return bool({"strain", "stretch", "stress"} & fall) or {"displacement", "force"} <= fall


def _falls(column: Array) -> bool:
    return bool(column[int(np.argmax(np.abs(column - column[0])))] < column[0])


def _own_strain(recording: Recording) -> Array | None:
    if "strain" in recording.columns:
        return recording.columns["strain"]
    return recording.columns["stretch"] - 1 if "stretch" in recording.columns else None


def _strain_choice(recording: Recording, length: float) -> _Choice:
    strain, name = _own_strain(recording), recording.names.get("strain", recording.names.get("stretch", ""))
    if strain is None:
        return _Choice(None, None)
    if "displacement" not in recording.columns:
        return _Choice(strain, None, (f"Column '{name}' is the strain, as measured.",))
    travel, other = recording.columns["displacement"], recording.names["displacement"]
    slope, missed = _multiple(strain, travel)
    size = abs(slope)
    if not length:
        said = f"Column '{name}' is the strain; '{other}', of the same motion, is not used: no height is known."
        if missed < _FOLLOWS:
            return _Choice(strain, size, (said,))
        return _Choice(strain, size, (), (
            f"Two columns measure the strain in {recording.label}: '{name}' is used, as measured on the specimen, and "
            f"'{other}', which moves otherwise by up to {percent(missed, 2)} of its range, is not.",))
    if missed < _FOLLOWS and abs(size / length - 1) < _AGREES:
        return _Choice(None, None, (f"Column '{name}' is '{other}' over {size * 1e3:.4g} mm, as the sizes say: one "
                                    "measurement, of which the displacement is used.",))
    if missed < _FOLLOWS and not _ON_SPECIMEN.search(name.lower()):
        raise _contradiction(recording, f"column '{name}' is '{other}' over {size * 1e3:.4g} mm, and the sizes of the "
                             f"specimen say {length * 1e3:.4g} mm", name, "strain", other, "displacement")
    if not 1 / _OTHER_UNIT < np.ptp(strain) * length / np.ptp(travel) < _OTHER_UNIT:
        raise _contradiction(recording, f"column '{name}' spans {np.ptp(strain):.3g}, and '{other}' over the length of "
                             f"{length * 1e3:.4g} mm spans {np.ptp(travel) / length:.3g}: check the unit of both (a "
                             "strain in per cent is given as strain=COLUMN:%)", name, "strain", other, "displacement")
    return _Choice(strain, None, (), (_differing_strains(recording, strain, travel / length, name, other),))


def _stress_choice(recording: Recording, area: float) -> _Choice:
    stress, name = recording.columns.get("stress"), recording.names.get("stress", "")
    if stress is None:
        return _Choice(None, None)
    if "force" not in recording.columns:
        return _Choice(stress, None, (f"Column '{name}' is the stress, as measured.",))
    other = recording.names["force"]
    slope, missed = _multiple(stress, recording.columns["force"])
    size = abs(slope)
    if not area:
        said = f"Column '{name}' is the stress; '{other}' is not used: no cross-section is known."
        return _Choice(stress, size, (said,)) if missed < _FOLLOWS else _Choice(stress, size, (), (
            f"Two columns measure the load in {recording.label}: '{name}' is used, and '{other}', which differs from a "
            f"multiple of it by up to {percent(missed, 2)} of its range, is not.",))
    if missed < _FOLLOWS and abs(size / area - 1) < _AGREES:
        return _Choice(None, None, (f"Column '{name}' is '{other}' over {size * 1e6:.4g} mm2, as the sizes say: one "
                                    "measurement, of which the force is used.",))
    how = (f"is '{other}' over {size * 1e6:.4g} mm2" if missed < _FOLLOWS else
           f"is '{other}' over no one area (it differs by up to {percent(missed, 2)} of its range)")
    raise _contradiction(recording, f"column '{name}' {how}, and the sizes of the specimen say {area * 1e6:.4g} mm2",
                         name, "stress", other, "force")


def _contradiction(recording: Recording, problem: str, name: str, quantity: str, other: str,
                   of_frame: str) -> InputFileError:
    return InputFileError(recording.paths[0], f"{problem}. Correct the sizes, or say which column counts, all columns "
                          f"that are used named: --columns with {quantity}={name} or with {of_frame}={other}.")


def _differing_strains(recording: Recording, strain: Array, by_frame: Array, name: str, other: str) -> str:
    """What two measures of strain say, where they differ, and what that is in stress."""
    direct, frame = (x - x[0] for x in (strain, by_frame))
    far = int(np.argmax(np.abs(direct)))
    text = (f"Two columns measure the strain in {recording.label}: '{name}' is used, as measured on the specimen, and "
            f"not '{other}', which holds what else gives way: they reach {abs(direct[far]):.3g} and "
            f"{abs(frame[far]):.3g}")
    load = recording.columns.get("stress", recording.columns.get("force"))
    if load is None or not far:
        return f"{text}."
    half = 0.5 * min(abs(direct[far]), abs(frame[far]))
    first, second = (abs(float(load[int(np.argmax(np.abs(x[:far + 1]) >= half))] - load[0])) for x in (direct, frame))
    if not first:
        return f"{text}."
    return (f"{text}; by the other the stress at a strain of {half:.2g} would be {percent(abs(second / first - 1), 2)} "
            f"{'lower' if second < first else 'higher'}.")


def _multiple(x: Array, y: Array) -> tuple[float, float]:
    """Slope of the straight line y(x), and the largest distance from it, noise averaged, as a share of y's range."""
    if np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0, np.inf
    slope, offset = np.polyfit(x, y, 1)
    edges = np.unique(np.linspace(0, x.size, min(_BLOCKS, x.size) + 1).astype(int))
    return float(slope), float(np.abs(block_means(y - slope * x - offset, edges)).max() / np.ptp(y))
