"""What the readings of a sensor say of themselves, without a model and with one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.scene.drive import read_out
from eitsim.scene.electrodes import among_all, identical, present
from eitsim.sensors import reading_checks, untouched_scatter
from eitsim.sensors.companions import FEWEST, in_step, late_readings
from eitsim.sensors.conventions import MEAN, counts_for, counts_for_two
from eitsim.sensors.identification import CERTAIN, Identified, has_sign, identified, stated
from eitsim.sensors.order_evidence import as_silent, not_taken, vouched
from eitsim.sensors.outlined_skin import OutlinedSkin, on_body, outlined_skin, read_between
from eitsim.sensors.reading_checks import Apart
from eitsim.sensors.recognition import (
    Order,
    canonical,
    exchanged,
    numberings,
    orders_of_conventions,
    orders_of_sensor,
)
from eitsim.sensors.recording import Recording, in_phase
from eitsim.sensors.sensor_file import Sensor, pairs_of
from eitsim.sensors.unmeasured import unmeasured
from touchcal.arrays import Array, Index, Mask

# Part of the touched frames in which readings have their rarer sign, above which they are differences.
_BOTH_SIGNS = 0.05
_START = 10  # one in so many frames is of the start of a recording


@dataclass(frozen=True, eq=False)
class Inspection:
    """Findings of one recording; electrodes and readings count from 0."""

    recording: Recording
    sensor: Sensor | None  # what was known of it
    kind: str  # "voltage", "magnitude" or "difference", as the sensor file says or as it looks
    electrodes: int | None  # how many; None where that is open
    identified: Identified
    agrees: bool | None  # whether the readings are in the order of the sensor file; None without one, or where open
    dead_readings: Index
    not_taken: Index  # readings at driven electrodes that the board does not take: 0, empty, or at the range's end
    dead_electrodes: tuple[int, ...]
    late: Index  # readings of a row that belong to the frame before it
    noise: float | None  # of a reading over the frame's r.m.s.; None without repeated untouched frames
    lasting: float | None  # likewise, what lasts over untouched frames
    drift: float | None  # from the first untouched frames to the last, over the first
    repeat: Apart | None  # patterns driven twice in a frame
    source_against_sink: Apart | None  # patterns with source and sink exchanged
    reciprocity: Apart | None  # readings with drive and measurement exchanged
    # ways and turns of the electrodes on the sensor's body that fit the frame as well as the best; empty where none is
    # likelier than the others
    placements: tuple[tuple[int, int], ...]

    @property
    def placed(self) -> tuple[int, int] | None:
        """Way and turn of the electrodes on the sensor's body; None where open."""
        return self.placements[0] if len(self.placements) == 1 else None


def inspect(recording: Recording, sensor: Sensor | None = None) -> Inspection:
    """The order of a recording's readings, their sign, faults and noise, by symmetry, by reciprocity and, where it
    explains them, by a homogeneous disc, or the skin of a sensor with an outline.

    sensor: what is known of it; its drive is compared with what the readings look like. ValueError where it makes
    another number of readings than a frame has, or no differences of two voltages, or has an outline and electrodes
    without contact; where every reading is dead, or a magnitude is negative.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> import eitsim
    >>> from eitsim.electrics.forward.untouched import untouched_readings
    >>> frame = untouched_readings(eitsim.Scene(), 1e-3)
    >>> one = eitsim.Recording(frame[None], np.array([0]), None, np.array([""]), "voltage", Path("frames.csv"))
    >>> found = eitsim.inspect(one)
    >>> found.electrodes, found.identified.words()["pattern"], found.identified.sign
    (16, 'adjacent', 'positive')
    """
    values = in_phase(recording.readings)
    kind = sensor.kind if sensor else _kind(recording, values)
    known = pairs_of(sensor) if sensor else None
    if known is not None and len(known) != values.shape[1]:
        raise ValueError(f"{recording.source}: {values.shape[1]} readings a frame, and the sensor's drive makes "
                         f"{len(known)}. Correct [drive] in the sensor file.")
    if kind == "magnitude" and np.nanmin(values, initial=0.0) < 0:
        raise ValueError(f"{recording.source}: a reading is negative, and magnitudes are not. Correct kind in "
                         "[readings].")
    dead, rows = reading_checks.dead_readings(recording), recording.untouched & (kind != "difference")
    if dead.all():
        raise ValueError(f"{recording.source}: every reading is empty, 0 or never changes; nothing can be said of it. "
                         "Check that the board drives a current.")
    live = np.where(dead, np.nan, values / np.nanmax(np.abs(values)))
    signals, untouched = _signals(live, rows, kind), live[rows]
    late = late_readings(signals)
    signals = in_step(signals, late)
    # where nobody marked touches, the first frames are the likeliest to be without one
    first = slice(max(1, len(live) // _START) if rows.all() else None)
    profile = None if kind == "difference" else reading_checks.mean_frame(untouched[first] if rows.any() else live)
    own = recording.pairs
    counts = (sensor.electrodes.count,) if sensor else (
        tuple(sorted({*counts_for(values.shape[1]), *counts_for_two(values.shape[1])})) if own is None else (
            int(own.max()) + 1,))
    skin = outlined_skin(sensor.body, sensor.electrodes) if sensor and sensor.body.has_outline and (
        profile is not None) else None
    silent = unmeasured(values)
    found = stated(profile, own, kind=kind) if own is not None else identified(
        profile, signals, _orders(values.shape[1], counts, known), kind=kind, silent=silent, expected=known, skin=skin)
    agrees = _agrees(found, known, counts[0]) if known is not None else None
    if agrees is False and known is not None and own is None:
        described = Order(counts[0], known)
        if vouched(profile, silent, described) and as_silent(described, found.plausible, silent):
            found, agrees = replace(found, plausible=(*found.plausible, described)), None
        elif found.doubtful:
            agrees = None
    kind = "magnitude" if kind == "voltage" and found.sign == "magnitude" else kind
    pairs = known if known is not None else found.order.pairs if found.order else None
    count = counts[0] if len(counts) == 1 else found.plausible[0].count if not found.doubtful and len(
        {one.count for one in found.plausible}) == 1 else None
    compared = (None, None, None) if pairs is None or (pairs == MEAN).any() else _compared(
        signals if profile is None else profile[None], pairs, sensor,
        signed=kind == "voltage" and profile is not None and has_sign(profile))
    lost = reading_checks.dead_electrodes(dead, [(pairs[:, 2:] == k).any(axis=1) for k in range(count)]
                                          ) if pairs is not None and count else ()
    placements: tuple[tuple[int, int], ...] = ()
    if sensor and known is not None and profile is not None and agrees:
        placements = _placements(sensor, known, profile, skin, found.swapped, signed=kind == "voltage")
        if found.decided_by in ("disc", "skin"):
            model = read_between(_impedance(sensor) if skin is None else skin.impedances[0],
                                 on_body(known, placements[0] if placements else (1, 0), counts[0]))
            lost = sorted({*lost, *reading_checks.silent_electrodes(profile, model, known, counts[0])})
    idle = not_taken(pairs, silent) if pairs is not None else np.zeros_like(dead)
    return Inspection(recording, sensor, kind, count, found, agrees, np.flatnonzero(dead & ~idle), np.flatnonzero(idle),
                      tuple(lost), np.flatnonzero(late), untouched_scatter.noise(untouched),
                      untouched_scatter.lasting(untouched), untouched_scatter.drift(untouched), *compared,
                      placements=placements)


def _kind(recording: Recording, values: Array) -> str:
    """What readings look like where no sensor file says it: a voltage keeps its sign under touches, a difference does
    not."""
    if recording.kind != "voltage" or recording.untouched.any() or len(values) < FEWEST:
        return recording.kind
    positive = (values > 0).mean(axis=0)
    return "difference" if np.median(np.minimum(positive, 1 - positive)) > _BOTH_SIGNS else "voltage"


def _orders(readings: int, counts: tuple[int, ...], known: Index | None) -> Sequence[Order]:
    """The orders to compare: those of conventions, and those near a sensor's own where that follows none of them."""
    usual = orders_of_conventions(readings, counts)
    if known is None:
        return usual
    own = canonical(known, counts[0], False)
    return usual if any(canonical(one.pairs, one.count, False) == own for one in usual) else orders_of_sensor(
        known, counts[0])


def _signals(live: Array, untouched: Mask, kind: str) -> Array:
    """(touched frames, readings) less the last untouched frame before each, or the first one after."""
    if kind == "difference":
        return live
    if not untouched.any() or untouched.all():
        return live[:0]
    rows, touched = np.flatnonzero(untouched), np.flatnonzero(~untouched)
    before = rows[np.maximum(np.searchsorted(rows, touched) - 1, 0)]
    return live[touched] - live[before]


def _agrees(found: Identified, own: Index, count: int) -> bool | None:
    """Whether the sensor's own order is the one that is left; None where others are left with it, or none at all."""
    signed = found.sign not in ("magnitude", "unknown")
    keys = [canonical(one.pairs, one.count, signed) for one in found.plausible]
    if not keys:
        return None
    described = canonical(own, count, signed) in keys
    return (True if len(keys) == 1 else None) if described else False


def _compared(values: Array, pairs: Index, sensor: Sensor | None, *, signed: bool) -> tuple[Apart | None, ...]:
    """Repeats, source against sink, and reciprocity of values (frames, readings)."""
    current = np.ones(len(pairs))
    if sensor:
        asked = sensor.protocol
        current = np.repeat(np.abs(asked.currents_A).max(axis=1), asked.shape[1])
    return tuple(check(values, pairs, current, signed=signed) for check in (
        reading_checks.repeats, reading_checks.source_against_sink, reading_checks.reciprocity))


def _placements(sensor: Sensor, pairs: Index, profile: Array, skin: OutlinedSkin | None,
                swapped: tuple[int, int] | None, *, signed: bool) -> tuple[tuple[int, int], ...]:
    """Ways and turns by which electrodes may be numbered on the body, the likeliest first, which on a disc only
    electrodes of unequal places, widths or contacts tell; on a skin with an outline those that fit as well are its
    symmetries."""
    if skin is not None:
        order = Order(skin.count, pairs)
        likelihood = numberings(profile, exchanged(order, *swapped) if swapped else order, skin, signed=signed)
    elif identical(sensor.electrodes):
        return ()
    else:
        likelihood = _numberings_on_disc(sensor, profile)
    best = max(likelihood.values())
    return tuple(sorted((way for way, log in likelihood.items() if log >= best - CERTAIN),
                        key=lambda way: -likelihood[way]))


def _impedance(sensor: Sensor) -> Array:
    """(N, N) of a sensor as its file describes it, on a sheet of 1 S, Ohm; NaN of electrodes without contact."""
    return among_all(sensor.electrodes, untouched_impedance(sensor.body, present(sensor.electrodes), 1.0))


def _numberings_on_disc(sensor: Sensor, profile: Array) -> dict[tuple[int, int], float]:
    """Way and turn of the electrodes -> log likelihood of a frame, of the sensor as its file describes it."""
    count, kept = sensor.electrodes.count, np.isfinite(profile)
    z = _impedance(sensor)
    found = {}
    for way in (1, -1):
        for turn in range(count):
            to = (way * np.arange(count) + turn) % count
            model = read_out(sensor.drive, z[np.ix_(to, to)]).ravel()
            if sensor.kind == "magnitude":
                model = np.abs(model)
            both = kept & np.isfinite(model)
            rest = profile[both] - model[both] * (profile[both] @ model[both]) / (model[both] @ model[both])
            found[way, turn] = -len(rest) / 2 * float(np.log(np.mean(rest**2)))
    return found
