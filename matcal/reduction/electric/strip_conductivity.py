"""A coated strip or a block strained while its resistance is recorded: conductivity against strain (paper, section
3.2)."""

from collections.abc import Sequence

import numpy as np

from matcal.laws.conductivity import strip_conductivity
from matcal.readers.recording import Recording
from matcal.reduction.electric import clock_alignment
from matcal.reduction.electric.circuit import ELECTRIC, Circuit, circuit_of, no_resistance
from matcal.reduction.electric.clock_alignment import Shift
from matcal.reduction.electric.conductor_strain import side_of, strain_of_rows, with_travel
from matcal.reduction.electric.cyclic_resistance import (
    Turns,
    cycle_table,
    settling_facts,
    settling_sentences,
    turning_points,
)
from matcal.reduction.experiment import Experiment
from matcal.reduction.specimen import Strip
from matcal.reduction.stroke_segments import Stroke, find_stroke
from matcal.statistics.block_means import block_means, equal_blocks, sample_noise
from touchcal.arrays import Array
from touchcal.errors import InputFileError

_POINTS = 100
_CYCLIC = 3  # from this many loadings on a test is the cyclic stage


def reduce_stretch(recordings: Sequence[Recording], strip: Strip) -> Experiment:
    """c = L/(R A) of a strip strained until it tears, or of the last cycle where it is cycled; S/m.

    L = L_0 (1 + e) is the current length and A the cross-section that conducts, kept as it is at rest: a coated ring of
    constant thickness, or a block's. `recordings` are the frame's (displacement or strain, force, time) and the
    meter's (time with resistance, or current and perhaps potential), in any order, or both in one. The strip is taken
    to be gripped without slack, so that the strain is the travel over its length. InputFileError where one is missing.
    """
    frame, pot = _frame_and_meter(recordings, strip)
    moved, chosen, cautions = with_travel(frame, strip)
    try:
        stroke = find_stroke(moved.columns["displacement"])
    except ValueError as error:
        raise InputFileError(frame.paths[0], f"{error}, so there is no test in it.") from None
    side, why, doubts = side_of([frame] if frame is pot else [frame, pot], strip)
    length = side * strip.length_m
    strain = stroke.travel / length
    if strain.min() <= -1:
        raise InputFileError(frame.paths[0], f"the travel of {1e3 * stroke.travel.max():.4g} mm in compression leaves "
                                             f"nothing of a length of {1e3 * strip.length_m:.4g} mm. Check length_mm, "
                                             "the direction, and the unit of the displacement.")
    circuit = circuit_of(pot, strip)
    time = pot.columns["time"][:circuit.resistance_Ohm.size]
    conductance = 1 / circuit.resistance_Ohm
    cyclic = stroke.loadings >= _CYCLIC
    shift = _align(frame, pot, circuit, strain, cyclic)
    facts, said = {}, []
    if cyclic and frame is not pot:
        shift, slack, slack_sd = clock_alignment.shift_with_backlash(
            frame.columns["time"], stroke.travel, length, time, conductance, shift)
        strain = clock_alignment.with_backlash(stroke.travel, slack) / length
        facts = {"backlash_mm": slack * 1e3, "backlash_sd_mm": slack_sd * 1e3}
        said = [f"Backlash of the crosshead at its reversals, {slack * 1e3:.3f} ± {slack_sd * 1e3:.3f} mm by the best "
                "agreement of conductance with motion: after each reversal the strip is taken to stand still until it "
                "is used up."]
    when = time - shift.seconds
    first, last = _span(frame.columns["time"], stroke, cyclic)
    used = (when >= first) & (when <= last)
    if np.count_nonzero(used) < 10:
        raise InputFileError(pot.paths[0], f"only {np.count_nonzero(used)} of its samples fall into the stretch. Check "
                                           "that both files belong to one test.")
    e = np.interp(when, frame.columns["time"], strain)
    resistance = circuit.resistance_Ohm
    c = strip_conductivity(resistance[used], e[used], strip.length_m, strip.ring_area_m2)
    edges = equal_blocks(c.size, _POINTS)
    size = int(edges[1] - edges[0])
    noise = float(np.sqrt(np.mean([sample_noise(part) ** 2 for part in np.array_split(c, 10)]) / size))
    loading = slice(stroke.start, stroke.end + 1)
    rate = float(np.ptp(strain[loading]) / np.ptp(frame.columns["time"][loading]))
    facts |= {"clock_shift_s": shift.seconds, "clock_shift_sd_s": shift.sd_s, "strain_zero_sd": rate * shift.sd_s,
             "resistance_rest_Ohm": float(np.median(resistance[when < frame.columns["time"][stroke.start]])),
             "ring_area_m2": strip.ring_area_m2, "samples_per_point": float(size)}
    cycles = None
    if cyclic:
        rest, peak = _turning_points(pot, when, resistance, frame.columns["time"], np.abs(strain))
        cycles = cycle_table(rest, peak)
        doubt = facts.get("backlash_sd_mm", 0.0) * 1e-3 / float(np.ptp(stroke.travel))
        facts |= settling_facts(rest, peak, doubt)
        said += settling_sentences(facts)
    return Experiment(
        kind="conductivity", strain=block_means(e[used], edges), value=block_means(c, edges), noise=noise,
        time_s=block_means(when[used] - first, edges),
        source=tuple(dict.fromkeys(p.name for r in (frame, pot) for p in r.paths)),
        decisions=(*frame.notes, *(pot.notes if pot is not frame else ()), *chosen, *why, *circuit.notes,
                   *_sentences(shift, rate, strip, size), *said),
        cautions=(*cautions, *doubts, *circuit.cautions), facts=facts, cycles=cycles)


def reduce_rows(recording: Recording, strip: Strip) -> Experiment:
    """c = L/(R A) of a table that holds strain (or travel) and resistance row by row, or its own conductivity."""
    strain, said, cautions = strain_of_rows(recording, strip)
    notes, more = (), ()
    if "conductivity" in recording.columns:
        value = recording.columns["conductivity"]
    else:
        circuit = circuit_of(recording, strip)
        strain, notes, more = strain[:circuit.resistance_Ohm.size], circuit.notes, circuit.cautions
        value = strip_conductivity(circuit.resistance_Ohm, strain, strip.length_m, strip.ring_area_m2)
        notes += (_formula(strip),)
    return Experiment(kind="conductivity", strain=strain, value=value, source=tuple(p.name for p in recording.paths),
                      decisions=(*recording.notes, *said, *notes), cautions=(*cautions, *more))


def _frame_and_meter(recordings: Sequence[Recording], strip: Strip) -> tuple[Recording, Recording]:
    moving = [r for r in recordings if {"displacement", "strain", "stretch"} & set(r.columns)]
    measures = ELECTRIC if strip.series_resistance_Ohm is None else (*ELECTRIC, "potential")
    electric = [r for r in recordings if set(measures) & set(r.columns)]
    for found, what in ((moving, "displacement"), (electric, "current")):
        files = ", ".join(r.label for r in recordings)
        other = [r for r in recordings if r not in moving[:1] or "potential" in r.columns]
        if not found and what == "current" and other:
            raise no_resistance(other[0])
        if not found or not (timed := [r for r in found if "time" in r.columns]):
            missing = "time with it" if found else what + (" or resistance" if what == "current" else "")
            named = "" if found or what != "current" else ("name the column with --columns resistance=COLUMN:ohm (of a "
                                                           "divider potential=COLUMN:V), or ")
            raise InputFileError(recordings[0].paths[0], f"a conductivity test needs time with displacement and time "
                                 f"with current or resistance; {files} has no {missing}: {named}give "
                                 "conductivity=FRAME_FILE,POTENTIOSTAT_FILE.")
        found[:] = timed
    return moving[0], electric[0]


def _align(frame: Recording, pot: Recording, circuit: Circuit, strain: Array, cyclic: bool) -> Shift:
    if frame is pot:
        return Shift(0.0, 0.0, "one file, one clock")
    time = frame.columns["time"]
    try:
        moved = clock_alignment.shift_by_motion(time, strain, pot.columns["time"][:circuit.resistance_Ohm.size],
                                                1 / circuit.resistance_Ohm, cyclic)
    except ValueError as error:
        raise InputFileError(pot.paths[0], f"{error}. Check that both files belong to one test.") from None
    if cyclic or "force" not in frame.columns:
        return moved
    torn = clock_alignment.shift_by_break(time, frame.columns["force"], pot.columns["time"], circuit.signal)
    return moved if torn is None else clock_alignment.combined(moved, torn)


def _span(time: Array, stroke: Stroke, cyclic: bool) -> tuple[float, float]:
    """Frame times between which the conductivity is read: the rest and the stretch, or the last cycle."""
    if not cyclic:
        return float(time[0]), float(time[stroke.end])
    low = stroke.travel < 0.5 * stroke.travel.max()
    falls = np.flatnonzero(low[1:] & ~low[:-1])
    return float(time[falls[-2]]), float(time[falls[-1]])


def _turning_points(pot: Recording, when: Array, resistance: Array, time: Array, strain: Array) -> tuple[Turns, Turns]:
    inside = (when >= time[0]) & (when <= time[-1])
    try:
        return turning_points(np.interp(when[inside], time, strain), resistance[inside])
    except ValueError as error:
        raise InputFileError(pot.paths[0], f"{error}. Check that both files belong to one test.") from None


def _sentences(shift: Shift, rate: float, strip: Strip, size: int) -> list[str]:
    clock = ("Strain and resistance stand in one file, on one clock." if shift.sd_s == 0 else
             f"Potentiostat clock {shift.seconds:.3f} ± {shift.sd_s:.3f} s ahead of the frame's, from {shift.how}; in "
             f"strain that is ± {rate * shift.sd_s:.1g}.")
    return [clock, f"{_formula(strip)} Gripped without slack; means of {size} samples."]


def _formula(strip: Strip) -> str:
    area = f"{strip.ring_area_m2 * 1e6:.4g} mm2"
    return (f"c = L/(R A) with the current length and a coated ring of {area}, corners left out, thickness constant."
            if strip.coated else f"c = L/(R A) with the current length and a cross-section of {area}, kept as at rest.")
