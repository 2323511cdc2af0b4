"""A load frame's record of a block of foam, corrected: zero, drift, compliance, contact; then strain and stress.

Of a cyclic test one loading is kept, the last or the first; preconditioning is the user's choice, never an accident.
"""

from dataclasses import replace

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.contact_point import Contact, find_contact
from matcal.reduction.load_cycles import BRANCHES, Loading, one_loading
from matcal.reduction.loading_direction import SIGNS, named_direction, words_about
from matcal.reduction.loading_doubts import collapse, collapse_sentence
from matcal.reduction.size_checks import check_reach, check_sizes, fix_of_sizes
from matcal.reduction.specimen import Block
from matcal.reduction.stroke_segments import Stroke, find_stroke, with_smaller
from matcal.statistics.block_means import block_means, sample_noise
from touchcal.arrays import Array
from touchcal.errors import InputFileError

FEW_ROWS = "A table of strain and stress may have few rows."
# fewer samples than this before contact do not make a zero, unless the contact lies this many of its standard
# deviations after the start
_ENOUGH, _CLEAR = 20, 5.0
_UNLOADED = 0.05  # of the largest load: a record that begins in motion with more is said to begin under load


def correct(kind: str, recording: Recording, block: Block, branch: str = "last") -> Loading:
    """Strain and stress of a block from displacement, force and time, from contact on or over one later loading. Raises
    InputFileError where a column is missing or constant, nothing moves or is touched, or nothing tells compression from
    tension; ValueError for an unknown branch."""
    if branch not in BRANCHES:
        raise ValueError(f"branch '{branch}' is unknown; known: {', '.join(BRANCHES)}.")
    stroke = _stroke(recording)
    force, time = recording.columns["force"], recording.columns.get("time")
    noise = sample_noise(force)
    load_sign = sign_of_load(stroke, force)
    stroke = stroke if kind == "relaxation" else with_smaller(stroke, load_sign * force)
    stroke, broken = (stroke, ()) if kind == "relaxation" else _until_collapse(recording, stroke, load_sign * force)
    sign, why = _direction(kind, recording, block, stroke.sign, load_sign)
    notes = [*recording.notes, *block.notes, *why, _start_sentence(recording, stroke)]
    _check_touch(recording, stroke, load_sign * force, noise)
    check_sizes(kind, recording, block, stroke, load_sign * force, sign)
    load, drift, drift_sd = _without_drift(stroke, load_sign * force, time, block, noise)
    if drift_sd is not None:
        notes.append(f"Load drift of {load_sign * drift * 1e3:.3g} ± {drift_sd * 1e3:.1g} mN/s between the rests "
                     "before and after the test, both clear of the specimen, taken off.")
    try:
        contact, moved = _contact(stroke, load, block, noise, notes)
    except ValueError as error:
        raise InputFileError(
            recording.paths[0], f"{error}, so the contact cannot be found. Check {fix_of_sizes(kind)} and the unit of "
            "the displacement; if they are right, give preload_N, above 0, and the height at that load, or a record of "
            f"more samples. {FEW_ROWS}") from None
    if block.compliance_m_per_N:
        notes.append(f"Frame compliance {block.compliance_m_per_N * 1e3:g} mm/N taken off the travel.")
    first = int(np.argmax(moved >= contact.travel_m))
    check_reach(kind, recording, sign * (moved[stroke.end] - contact.travel_m) / block.length_m)
    facts = {"zero_load_N": load_sign * contact.zero_N, "drift_N_per_s": load_sign * drift + 0.0, "load_noise_N": noise,
             "zero_sd_Pa": contact.zero_sd_N / block.area_m2, "contact_mm": contact.travel_m * 1e3,
             "contact_sd_mm": contact.sd_m * 1e3, "strain_zero_sd": contact.sd_m / block.length_m,
             "area_mm2": block.area_m2 * 1e6,
             "compliance_mm_per_N": block.compliance_m_per_N * 1e3}
    if drift_sd is not None:
        facts["drift_sd_N_per_s"] = drift_sd
    whole = Loading(time_s=None if time is None else time[first:] - _contact_time(time, moved, first, contact.travel_m),
                    strain=sign * (moved[first:] - contact.travel_m) / block.length_m,
                    stress_Pa=sign * (load[first:] - contact.zero_N) / block.area_m2, end=stroke.end - first,
                    noise_Pa=noise / block.area_m2, decisions=tuple(notes), facts=facts,
                    cautions=broken + _begun_under_load(recording, load, stroke.start, contact))
    spans = tuple((max(begin - first, 0), end - first) for begin, end in stroke.spans)
    return whole if kind == "relaxation" else one_loading(whole, spans, branch, block.length_m)


def _stroke(recording: Recording) -> Stroke:
    path = recording.paths[0]
    if missing := [q for q in ("displacement", "force") if q not in recording.columns]:
        raise InputFileError(path, f"no {missing[0]} column; found: {', '.join(recording.names.values())}. Name it "
                                   f"{missing[0]}, or give every column that is used: `columns` displacement=COLUMN:mm,"
                                   "force=COLUMN:N,time=COLUMN:s.")
    if np.ptp(recording.columns["force"]) == 0:
        raise InputFileError(path, f"column '{recording.names['force']}' never changes, so there is no load in it.")
    if "time" in recording.columns and np.any(np.diff(recording.columns["time"]) < 0):
        raise InputFileError(path, "the time runs backwards, so the file is no record of one test.")
    try:
        return find_stroke(recording.columns["displacement"])
    except ValueError as error:
        raise InputFileError(path, f"{error}, so there is no test in it.") from None


def sign_of_load(stroke: Stroke, force: Array) -> float:
    """1 where the load grows in the loading, -1 where it falls, by its largest change."""
    change = force[stroke.start:stroke.end + 1] - np.median(force[:max(stroke.start, 1)])
    size = max(1, change.size // 50)
    mean = block_means(change, np.arange(0, change.size + 1, size))
    return 1.0 if mean[int(np.argmax(np.abs(mean)))] > 0 else -1.0


def _until_collapse(recording: Recording, stroke: Stroke, load: Array) -> tuple[Stroke, tuple[str, ...]]:
    """The stroke whose first loading ends at its largest load, where the load falls to nothing before the travel does;
    what is said of it."""
    part = slice(stroke.start, stroke.end + 1)
    top = collapse(stroke.travel[part], load[part] - float(np.median(load[:max(stroke.start, 1)])))
    if top is None or stroke.loadings > 1:
        return stroke, ()
    end = stroke.start + top
    said = collapse_sentence(recording.label, f"{1e3 * stroke.travel[end]:.4g} mm",
                             f"{1e3 * stroke.travel[stroke.end]:.4g} mm")
    return replace(stroke, end=end, spans=((stroke.start, end),)), (said,)


def _check_touch(recording: Recording, stroke: Stroke, load: Array, noise: float) -> None:
    """InputFileError where the load of the first loading does not rise above its noise."""
    size = max(1, min(20, (stroke.end - stroke.start) // 20))
    rest = float(np.median(load[:max(stroke.start, 1)]))
    top = float(load[max(stroke.end - size, 0):stroke.end + 1].mean()) - rest
    if top < 6 * noise / np.sqrt(size):
        raise InputFileError(recording.paths[0], f"the load rises by {top:.3g} N where its noise is {noise:.2g} N: the "
                                                 "specimen was not touched, or the load cell is far too large for it.")


def _start_sentence(recording: Recording, stroke: Stroke) -> str:
    start = recording.columns["displacement"][0] * 1e3
    more = f"; {stroke.loadings} loadings" if stroke.loadings > 1 else ""
    return (f"Travel counted from the rest position {start:.4g} mm, loading where the displacement "
            f"{'grows' if stroke.sign > 0 else 'falls'}{more}.")


def _without_drift(stroke: Stroke, load: Array, time: Array | None, block: Block,
                   noise: float) -> tuple[Array, float, float | None]:
    """Load without the drift between the rests before and after the test, where the specimen is clear in both; the
    drift and its standard deviation (None where it could not be measured), N/s."""
    if time is None or stroke.start < _ENOUGH:
        return load, 0.0, None
    margin = max(5 * stroke.noise_m, 1e-3 * stroke.travel.max())
    after = stroke.end + np.flatnonzero(stroke.travel[stroke.end:] < margin)
    first = _contact(stroke, load, block, noise, [])[0]
    if after.size < _ENOUGH or first.travel_m < margin + 5 * first.sd_m:
        return load, 0.0, None
    before = slice(0, stroke.start)
    rate = (load[after].mean() - load[before].mean()) / (time[after].mean() - time[before].mean())
    sd = noise * np.hypot(after.size**-0.5, stroke.start**-0.5) / (time[after].mean() - time[before].mean())
    return load - rate * (time - time[0]), float(rate), float(sd)


def _contact(stroke: Stroke, load: Array, block: Block, noise: float, notes: list[str]) -> tuple[Contact, Array]:
    """The contact and the travel of the specimen's end (frame compliance taken off), m."""
    rest = float(load[:max(stroke.start, 1)].mean())
    moved = stroke.travel - block.compliance_m_per_N * (load - rest)
    moving = slice(stroke.start, stroke.end + 1)
    size = int(np.clip((stroke.end - stroke.start) // 50, 1, 20))
    if block.preload_N > 0:
        at = _reaches(moved[moving], load[moving] - rest, block.preload_N, size)
        notes.append(f"Contact where the load reaches the preload {block.preload_N:g} N, as the height was measured.")
        return Contact(at, 0.0, rest, noise / np.sqrt(max(stroke.start, 1))), moved
    latest = float(moved[moving][_first_above(load[moving] - rest, 6 * noise / np.sqrt(size), size)].max())
    contact = find_contact(moved[:stroke.end + 1], load[:stroke.end + 1], stroke.start, block.length_m, latest)
    before = stroke.start + np.count_nonzero(moved[moving] < contact.travel_m)
    counted = f"{before} sample{'s' if before != 1 else ''}"
    if before < _ENOUGH and contact.travel_m < _CLEAR * contact.sd_m:
        notes.append(f"Only {counted} before the load rises: the first reading is taken as zero load and its position "
                     "as contact.")
        return Contact(0.0, 0.0, float(load[0]), noise), moved
    notes.append(f"Contact found {contact.travel_m * 1e3:.3f} ± {contact.sd_m * 1e3:.3f} mm after the start, where a "
                 f"smooth curve of unknown shape over {contact.reach:.0%} of strain begins; zero load from "
                 f"{counted}.")
    return contact, moved


def _begun_under_load(recording: Recording, load: Array, start: int, contact: Contact) -> tuple[str, ...]:
    """What is said of a record that moves from its first samples on with a load that counts as none."""
    share = float(contact.zero_N / np.abs(load).max())
    if start >= _ENOUGH or contact.travel_m > 0 or share < _UNLOADED:
        return ()
    return (f"{recording.label} moves from its first samples on, at {contact.zero_N:.3g} N, {share:.0%} of its largest "
            "load, which count as zero load at rest. If the specimen carried them, the beginning of the test is "
            "missing, and moduli and relaxation are off: give the record from before contact.",)


def _reaches(travel: Array, load: Array, level: float, size: int) -> float:
    """Travel at which means of `size` neighbouring samples reach the load `level`, straight from one mean to the next;
    ValueError where none does."""
    edges = np.arange(0, load.size + 1, size)
    x, y = block_means(travel, edges), block_means(load, edges)
    if y.max() < level:
        raise ValueError(f"the load reaches {y.max():.3g} N, less than preload_N = {level:g}")
    first = int(np.argmax(y >= level))
    around = slice(max(first - 1, 0), first + 1)
    return float(np.interp(level, y[around], x[around]))


def _first_above(load: Array, level: float, size: int) -> slice:
    """The first `size` neighbouring samples whose mean passes `level`, the last ones where none does."""
    edges = np.arange(0, load.size + 1, size)
    above = np.flatnonzero(block_means(load, edges) > level)
    first = int(edges[above[0] if above.size else -2])
    return slice(first, first + size)


def _contact_time(time: Array, moved: Array, first: int, at: float) -> float:
    """Time of contact, interpolated between the two samples around it."""
    around = slice(max(first - 1, 0), first + 1)
    return float(np.interp(at, moved[around], time[around]))


def _direction(kind: str, recording: Recording, block: Block, sign: float,
               load_sign: float) -> tuple[float, tuple[str, ...]]:
    """-1 for compression, 1 for tension and shear, and what says so."""
    if kind == "shear":
        return 1.0, ()
    if kind == "volumetric":
        return -1.0, ("Compression, as every volumetric test.",)
    named = named_direction(words_about(recording)) or named_direction([*recording.names.values()])
    if block.direction is not None:
        return SIGNS[block.direction], (f"{block.direction.capitalize()}, as the specimen says.",)
    if named is not None:
        return SIGNS[named], (f"{named.capitalize()}, from the test's own name.",)
    if sign < 0 and load_sign < 0:
        return -1.0, ("Displacement and load both fall: taken as compression.",)
    if kind in ("planar", "biaxial") and not named:
        return 1.0, (f"Nothing tells the direction: tension is assumed, as a sheet in a {kind} test is pulled.",)
    raise InputFileError(recording.paths[0], "nothing tells whether this is compression or tension. Write direction = "
                                             f"\"compression\" or \"tension\" in [{kind}] of the specimen file.")
