"""A coated strip stretched under constant voltage: conductivity against strain (paper, section 3.2)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from matcal.laws.conductivity import strip_conductivity
from matcal.readers.recording import Recording
from matcal.reduction.electric import clock_alignment
from matcal.reduction.electric.clock_alignment import Shift
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


@dataclass(frozen=True)
class _Circuit:
    """The electrical record while the strip was whole."""

    time_s: Array  # (n,) time on the potentiostat's clock, s
    conductance_S: Array  # (n,) conductance, S
    notes: tuple[str, ...]  # what was assumed


def reduce_stretch(recordings: Sequence[Recording], strip: Strip) -> Experiment:
    """c = L/(R A) of a strip stretched until it tears, or of the last cycle where it is cycled; S/m.

    L = L_0 (1 + e) is the current length and A the coated ring at constant coating thickness. `recordings` are the
    frame's (displacement, force, time) and the potentiostat's (time, current), in any order. The strip is taken to be
    gripped without slack, so that the strain is the travel over its length. InputFileError where one is missing.
    """
    frame, pot = _frame_and_potentiostat(recordings)
    try:
        stroke = find_stroke(frame.columns["displacement"])
    except ValueError as error:
        raise InputFileError(frame.paths[0], f"{error}, so there is no test in it.") from None
    strain = stroke.travel / strip.length_m
    circuit = _circuit(pot, strip)
    cyclic = stroke.loadings >= _CYCLIC
    shift = _align(frame, pot, circuit, strain, cyclic)
    facts, said = {}, []
    if cyclic and frame is not pot:
        shift, slack, slack_sd = clock_alignment.shift_with_backlash(
            frame.columns["time"], stroke.travel, strip.length_m, circuit.time_s, circuit.conductance_S, shift)
        strain = clock_alignment.with_backlash(stroke.travel, slack) / strip.length_m
        facts = {"backlash_mm": slack * 1e3, "backlash_sd_mm": slack_sd * 1e3}
        said = [f"Backlash of the crosshead at its reversals, {slack * 1e3:.3f} ± {slack_sd * 1e3:.3f} mm by the best "
                "agreement of conductance with motion: after each reversal the strip is taken to stand still until it "
                "is used up."]
    when = circuit.time_s - shift.seconds
    first, last = _span(frame.columns["time"], stroke, cyclic)
    used = (when >= first) & (when <= last)
    if np.count_nonzero(used) < 10:
        raise InputFileError(pot.paths[0], f"only {np.count_nonzero(used)} of its samples fall into the stretch. Check "
                                           "that both files belong to one test.")
    e = np.interp(when, frame.columns["time"], strain)
    resistance = 1 / circuit.conductance_S
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
        rest, peak = _turning_points(pot, when, resistance, frame.columns["time"], strain)
        cycles = cycle_table(rest, peak)
        doubt = facts.get("backlash_sd_mm", 0.0) * 1e-3 / float(np.ptp(stroke.travel))
        facts |= settling_facts(rest, peak, doubt)
        said += settling_sentences(facts)
    return Experiment(
        kind="conductivity", strain=block_means(e[used], edges), value=block_means(c, edges), noise=noise,
        time_s=block_means(when[used] - first, edges), source=tuple(p.name for r in (frame, pot) for p in r.paths),
        decisions=(*frame.notes, *pot.notes, *circuit.notes, *_sentences(shift, rate, strip, size), *said),
        facts=facts, cycles=cycles)


def _frame_and_potentiostat(recordings: Sequence[Recording]) -> tuple[Recording, Recording]:
    found = {}
    for quantity in ("displacement", "current"):
        holders = [r for r in recordings if quantity in r.columns and "time" in r.columns]
        if not holders:
            files = ", ".join(r.label for r in recordings)
            raise InputFileError(recordings[0].paths[0], f"a conductivity test needs time with displacement and time "
                                                         f"with current; {files} has no {quantity}. Give "
                                                         "conductivity=FRAME_FILE,POTENTIOSTAT_FILE.")
        found[quantity] = holders[0]
    return found["displacement"], found["current"]


def _circuit(pot: Recording, strip: Strip) -> _Circuit:
    current = np.abs(pot.columns["current"])
    voltage, notes = np.abs(pot.columns.get("potential", np.full(current.size, strip.voltage_V or np.nan))), ()
    if "potential" not in pot.columns:
        if strip.voltage_V is None:
            raise InputFileError(pot.paths[0], "no potential column, and the specimen has no voltage_V. Give either.")
        notes = (f"No potential column: {strip.voltage_V:g} V taken from the specimen.",)
    elif strip.voltage_V is not None and abs(np.median(voltage) / strip.voltage_V - 1) > 0.05:
        raise InputFileError(pot.paths[0], f"its potential is {np.median(voltage):.4g} V but the specimen says "
                                           f"voltage_V = {strip.voltage_V:g}. Correct one of them.")
    whole = current > 0.02 * np.median(current[:max(10, current.size // 50)])
    if not whole[0]:
        raise InputFileError(pot.paths[0], "no current flows at the start. Check the contacts.", line=pot.first_line)
    until = current.size if whole.all() else int(np.argmin(whole)) - 1
    if until < current.size:
        notes += (f"Current collapses after {until} of {current.size} samples; the rest is left out.",)
    return _Circuit(pot.columns["time"][:until], current[:until] / voltage[:until], notes)


def _align(frame: Recording, pot: Recording, circuit: _Circuit, strain: Array, cyclic: bool) -> Shift:
    if frame is pot:
        return Shift(0.0, 0.0, "one file, one clock")
    time = frame.columns["time"]
    try:
        moved = clock_alignment.shift_by_motion(time, strain, circuit.time_s, circuit.conductance_S, cyclic)
    except ValueError as error:
        raise InputFileError(pot.paths[0], f"{error}. Check that both files belong to one test.") from None
    if cyclic or "force" not in frame.columns:
        return moved
    torn = clock_alignment.shift_by_break(time, frame.columns["force"], pot.columns["time"], pot.columns["current"])
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
    return [f"Potentiostat clock {shift.seconds:.3f} ± {shift.sd_s:.3f} s ahead of the frame's, from {shift.how}; in "
            f"strain that is ± {rate * shift.sd_s:.1g}.",
            f"c = L/(R A) with the current length and a coated ring of {strip.ring_area_m2 * 1e6:.4g} mm2, corners "
            f"left out, thickness constant; gripped without slack; means of {size} samples."]
