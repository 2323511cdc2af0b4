"""An inspection as plain values, as sentences, and as the questions that it leaves to the user."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from eitsim.scene.drive import Drive
from eitsim.scene.edges.outline_electrodes import along_edge
from eitsim.scene.electrodes import Electrodes, identical
from eitsim.scene.scene import Body, Skin
from eitsim.sensors.companions import FEWEST
from eitsim.sensors.conventions import MEAN, counts_for, pattern_name
from eitsim.sensors.formats.layout import FEWEST_READINGS
from eitsim.sensors.identification import EXPLAINED, words_of
from eitsim.sensors.inspection import Inspection
from eitsim.sensors.reading_checks import NO_OHMMETER, Apart, mean_frame
from eitsim.sensors.recognition import Order, canonical
from eitsim.sensors.recording import in_phase
from eitsim.sensors.sensor_file import Sensor, pairs_of
from touchcal.arrays import Index
from touchcal.number_words import counted, percent

_SAID = 0.02  # what should be the same and differs by more than this is said
_DRIFT, _MOST_NAMED = 0.02, 4
# what [drive] calls readings, by what a convention reads against
_READINGS = {"pair": "differential", "before": "single-ended"}
_ROWS = {"turn": "turn: where drives begin", "direction": "direction: way of the drives"}
_PRESSES = ("Press where the file puts electrode 0, then where it puts 1, and run `eitsim reconstruct`: an image at "
            "electrode m of the file says that m of the readings lies where was pressed. Then list places in "
            "[electrodes] in the order of the readings.")
_SIGNS = {"positive": "plus less minus, for current from source to sink",
          "negative": "minus less plus, for current from source to sink: leads of the current or of the voltmeter are "
                      "exchanged",
          "magnitude": "magnitudes: the sign is lost",
          "either": "all of one sign, as this order's readings are: magnitudes would look the same"}


def document(found: Inspection) -> dict[str, Any]:
    """An inspection as plain JSON values; null where the readings do not say it."""
    one, words, order = found.identified, found.identified.words(), found.identified.order
    return {"recording": str(found.recording.source), "frames": len(found.recording.readings),
            "untouched_frames": int(found.recording.untouched.sum()), "readings": found.recording.readings.shape[1],
            "kind": found.kind, "electrodes": found.electrodes, **words,
            "first_electrode": int(order.pairs[0, 0]) if order else None, "sign": None if one.sign == "unknown" else
            one.sign, "decided_by": one.decided_by, "unexplained": _number(one.unexplained),
            "plausible_orders": [words_of(each) for each in one.plausible],
            "pairs": order.pairs.tolist() if order else None,
            "agrees_with_sensor": found.agrees,
            "placements": [{"way": way, "turn": turn} for way, turn in found.placements],
            "placed_on_body": dict(zip(("way", "turn"), found.placed, strict=True)) if found.placed else None,
            "swapped_electrodes": list(one.swapped) if one.swapped else None,
            "level": one.level or None, "readings_not_taken": found.not_taken.tolist(),
            "dead_readings": found.dead_readings.tolist(), "dead_electrodes": list(found.dead_electrodes),
            "late_readings": found.late.tolist(), "noise": found.noise,
            "noise_dB": None if not found.noise else 20 * float(np.log10(found.noise)), "lasting": found.lasting,
            "drift": found.drift,
            **{name: _apart(getattr(found, name)) for name in ("repeat", "source_against_sink", "reciprocity")},
            "cautions": list(cautions(found)), "questions": list(questions(found))}


def rows(found: Inspection) -> Iterator[tuple[str, str]]:
    """What was found, a name and its words a row."""
    one, words = found.identified, found.identified.words()
    frames, touchless = len(found.recording.readings), int(found.recording.untouched.sum())
    unmarked = ", as none is marked as touched" if touchless == frames > 1 else ""
    yield "recording", (f"{counted(frames, 'frame')}, {touchless} untouched{unmarked}, "
                        f"{counted(found.recording.readings.shape[1], 'reading')} each: {found.kind}")
    yield "electrodes", "not decided" if found.electrodes is None else str(found.electrodes)
    for name in ("pattern", "order", "turn", "direction"):
        yield _ROWS.get(name, name), words[name] or "not decided"
    yield "sign", _SIGNS.get(one.sign, "not decided")
    yield "decided by", {"disc": "a homogeneous disc", "skin": "a homogeneous skin of the sensor file's outline",
                         "touches": "touches: readings of one pair change together",
                         "driven": "readings without a measurement, which are those of driven electrodes",
                         "file": "the recording's file, which states it", "nothing": "nothing"}[one.decided_by]
    if np.isfinite(one.unexplained):
        yield "unexplained", (f"{percent(one.unexplained)} of the untouched frame, by an imperfect homogeneous "
                              f"{_body(found)}")
    if found.agrees is None and (drive := _described(found)):
        yield "in a sensor file", drive
    if found.sensor is not None:
        allowed = (f"not contradicted: one of {len(one.plausible)} orders that the readings allow"
                   if one.plausible and not one.doubtful else "neither confirmed nor contradicted")
        yield "sensor file", {True: "[drive] agrees with the readings, the electrodes' places do not" if
                              _elsewhere(found) else "agrees with the readings",
                              False: "contradicted by the readings", None: allowed}[found.agrees]
    if found.noise is not None:
        yield "noise", f"{percent(found.noise)} of the frame's r.m.s. a reading, from one untouched frame to the next"
    if found.lasting is not None:
        yield "lasting changes", f"{percent(found.lasting)} of it, standard deviation over the untouched frames"
    if found.drift is not None:
        yield "drift", f"{percent(found.drift)} of the untouched frame from the first tenth of them to the last"
    for name, what in (("repeat", "a pattern driven twice"), ("source_against_sink", "source and sink exchanged"),
                       ("reciprocity", "drive and measurement exchanged")):
        if (apart := getattr(found, name)) is not None:
            yield what, f"{_range(apart)} from each other ({counted(apart.compared, 'comparison')})"


def cautions(found: Inspection) -> Iterator[str]:
    """What a user is to know before these readings are used."""
    one = found.identified
    if found.agrees is False:
        yield (("The recording's file states another order than [drive] of the sensor file: "
                if one.decided_by == "file" else "The readings contradict [drive] of the sensor file: they look like ")
               + "; or ".join(", ".join(words_of(each).values()) for each in one.plausible[:2]) + "."
               + (_drive_of(one.plausible[0], found.sensor) if found.sensor else ""))
    frames, readings = found.recording.readings.shape
    if readings < FEWEST_READINGS <= frames and counts_for(frames):
        yield (f"There are {frames} frames of {counted(readings, 'reading')}, and {frames} readings a frame are usual: "
               "are rows and columns exchanged?")
    if one.swapped:
        yield f"The leads of electrodes {one.swapped[0]} and {one.swapped[1]} look exchanged. Check them."
    if found.dead_electrodes:
        yield (f"Electrode {found.dead_electrodes[0]} is dead: open, or its channel is." if
               len(found.dead_electrodes) == 1 else
               f"Electrodes {_listed(np.array(found.dead_electrodes))} are dead: open, or their channels are.")
    if found.dead_readings.size:
        yield (("Reading {} is" if found.dead_readings.size == 1 else "Readings {} are").format(
            _listed(found.dead_readings)) + " dead: empty, 0, at the end of the range or unchanging in every frame.")
    if found.not_taken.size:
        yield (f"{counted(found.not_taken.size, 'reading')} of driven electrodes hold no measurement (0, empty or at "
               "the end of the range), and are left out.")
    if one.level:
        yield (f"All readings look offset by {_level(found):.4g}: a number is added to them. Subtract it before "
               "`eitsim sensor fit`; changes do not need it.")
    if (empty := np.flatnonzero(np.isnan(found.recording.readings).all(axis=1))).size:
        yield (f"{counted(empty.size, 'frame')} without any reading, the first in row {empty[0]} from 0: not counted "
               "here, refused by `eitsim reconstruct`. Leave them out.")
    if np.iscomplexobj(found.recording.readings):
        yield (f"The readings are complex: they are turned to their common phase, and {percent(_out_of_phase(found))} "
               "of them, which stays imaginary, is left out.")
    if found.late.size:
        yield (f"Readings {_listed(found.late)} of each row belong to the frame before it: they change with the others "
               "of the row above. Begin a row where the scan begins, or move them up by one row (`surrogate learn` "
               "does so itself).")
    if found.kind != "difference" and not found.recording.untouched.any():
        yield "No frame is untouched: the mean of all stands for it. Leave touch empty where nothing touches."
    if one.unexplained > EXPLAINED:
        yield (f"No homogeneous {_body(found)} explains the untouched frame: the best order leaves "
               f"{percent(one.unexplained)}. Use changes only; an absolute model is not to be trusted.")
    if _elsewhere(found):
        yield ("Electrodes do not lie on the skin as the sensor file says: the untouched frame fits them best "
               f"{_placements(found)}. {_renumbered(found)}")
    for apart, what in ((found.source_against_sink, "source and sink"), (found.reciprocity, "drive and measurement")):
        if apart is not None and apart.most > _SAID:
            yield (f"Readings with {what} exchanged are {_range(apart)} from each other, which a linear, reciprocal, "
                   "ground-free instrument makes 0." + (" These are no voltages of a passive body: use changes only."
                                                        if apart.together >= NO_OHMMETER else ""))
    if found.drift is not None and found.drift > _DRIFT:
        yield (f"The untouched frame drifts by {percent(found.drift)}: take a fresh one close to each touch."
               + (" Or some frames are touched, and none is marked so: name them in the column touch of a CSV, or save "
                  "a .mat as vh (untouched) and vi (touched)." if found.recording.untouched.all() else ""))


def questions(found: Inspection) -> Iterator[str]:
    """What the readings leave open, as questions to the user."""
    one, words = found.identified, found.identified.words()
    if not one.plausible and found.sensor is None and one.decided_by == "nothing":
        if found.electrodes is None and not np.isfinite(one.unexplained):
            yield ("Which currents are driven and what is read? No common order makes "
                   f"{found.recording.readings.shape[1]} readings. Give a sensor file with [drive] pairs.")
        else:
            yield (f"Which order do the readings have? Neither a {_body(found)} nor touches say it. {FEWEST} touches "
                   "at many places, an untouched frame before each, may. Or give a sensor file with [drive] pairs.")
    elif len(one.plausible) > 1 and found.sensor is not None and found.agrees is None:
        yield (f"Is [drive] of the sensor file right? {counted(len(one.plausible) - 1, 'other order')} would make "
               "these readings as well; the board's manual or firmware says it.")
    elif len(one.plausible) > 1:
        open_ones = [key for key, value in words.items() if value is None] or ["order"]
        doubt = "No disc fits well, and another order may be right. " if one.doubtful else ""
        likely = "; or ".join(", ".join(words_of(each)[key] for key in open_ones) for each in one.plausible[:3])
        yield (f"What is the {' and the '.join(open_ones)}? {len(one.plausible)} orders are left; the likeliest: "
               f"{likely}. {doubt}The board's manual or firmware says it"
               + ("." if one.decided_by == "touches" else f"; or touch the skin at {FEWEST} places."))
    if one.sign == "unknown":
        yield ("Are readings plus less minus or the other way round? Differences alone do not say it; one untouched "
               "frame does." if found.kind == "difference" else
               "Are readings plus less minus or the other way round? "
               + ("Without their order that is open." if one.order is None else "The untouched frame does not say it."))
    if found.kind == "difference" and found.sensor is None:
        yield "Are these touched less untouched frames? Their signs look so. Say kind in [readings] of a sensor file."
    if _outlined(found):
        yield from _on_skin(found)
    elif found.placed is None and (found.sensor is None or identical(found.sensor.electrodes)):
        yield ("Where on the body is electrode 0, and which way round do they count, seen from the touched side? An "
               "even ring looks the same from every electrode and in a mirror"
               + ("; press next to electrode 0, then 1." if found.sensor is None else f". {_PRESSES}"))
    elif found.placed is None:
        yield ("Do the electrodes lie on the body as the sensor file says? The untouched frame does not tell. "
               f"{_PRESSES}")
    elif found.placed != (1, 0):
        way = "the same way round" if found.placed[0] == 1 else "the other way round"
        yield (f"Is electrode 0 of the readings electrode {found.placed[1]} of the sensor file, counting {way}? Its "
               "unequal electrodes fit the frame best so.")


def _on_skin(found: Inspection) -> Iterator[str]:
    """Where electrodes lie on a skin with an outline."""
    if len(found.placements) > 1 and (1, 0) in found.placements:
        yield (f"Is electrode 0 of the readings that of the sensor file? {counted(len(found.placements), 'numbering')} "
               f"fit the untouched frame, {_placements(found)}, since the skin looks the same so. "
               f"{_PRESSES}")
    elif not found.placements:
        yield ("Do the electrodes lie on the skin as the sensor file says? The untouched frame does not tell. "
               f"{_PRESSES}")


def _elsewhere(found: Inspection) -> bool:
    """Whether the untouched frame says that electrodes lie elsewhere than in the sensor file."""
    return bool(found.placements) and (1, 0) not in found.placements


def _renumbered(found: Inspection) -> str:
    """How a sensor file says that electrodes lie as the untouched frame says."""
    assert found.sensor is not None
    body, electrodes = found.sensor.body, found.sensor.electrodes
    way, turn = max(found.placements, key=lambda one: one[0])  # the likeliest, of the same way round where there is one
    if not electrodes.along_edge:
        return "List x_mm and y_mm in [electrodes] in the order of the readings, or correct the outline."
    if not _outlined(found):
        return "List their angles_deg in [electrodes] in the order of the readings."
    order = (way * np.arange(electrodes.count) + turn) % electrodes.count
    places_mm = 1e3 * along_edge(body.outline, electrodes)[order]
    first = ", ".join(f"{place:.6g}" for place in places_mm[:_MOST_NAMED])
    return (f"List their places in [electrodes] in the order of the readings, positions_mm = [{first}, ...], or "
            "correct the outline.")


def _drive_of(order: Order, sensor: Sensor) -> str:
    """What [drive] of a sensor file is to say for an order."""
    if (named := _named(order, sensor.electrodes)) is not None:
        return (f' The first is pattern = "{named.pattern}" with reading = "{named.reading}" in [drive], where '
                f'"{Drive.reading}" is the default.')
    return " Describe the drive by pairs in [drive]; --pairs pairs.csv writes those of the first."


def _named(order: Order, electrodes: Electrodes) -> Drive | None:
    """The drive of an order by the names that [drive] has; None where it needs pairs."""
    one, step = order.convention, int(order.pairs[0, 1] - order.pairs[0, 0])
    if one is None or one.kept != "undriven" or one.reference not in _READINGS:
        return None
    named = Drive(pattern=pattern_name(step, order.count), reading=_READINGS[one.reference])
    own = canonical(pairs_of(Sensor(Body(), Skin(), electrodes, named)), order.count, False)
    return named if own == canonical(order.pairs, order.count, False) else None


def pairs_as_read(found: Inspection) -> Index | None:
    """(readings, 4) source, sink, plus and minus of each reading in the likeliest order, plus and minus exchanged where
    the readings' sign is that of minus less plus; None where no order is found, or one that no pairs describe."""
    order = found.identified.order
    if order is None or (order.pairs == MEAN).any():
        return None
    return order.pairs[:, [0, 1, 3, 2]] if found.identified.sign == "negative" else order.pairs


def _described(found: Inspection) -> str:
    """[drive] of a sensor file with the order found, or with the likeliest one that has a name; empty without any."""
    one = found.identified
    likeliest = one.order or (one.plausible[0] if one.plausible else None)
    named = _named(likeliest, Electrodes(count=likeliest.count)) if likeliest and one.sign != "negative" else None
    if named is not None:
        return (f'[drive] pattern = "{named.pattern}", reading = "{named.reading}"'
                + ", if the likeliest order is right" * (one.order is None))
    return '[drive] pairs = "pairs.csv", which --pairs pairs.csv writes' if pairs_as_read(found) is not None else ""


def _placements(found: Inspection) -> str:
    """Ways to number the electrodes on the body, in words."""
    ways = [f"with electrode 0 at electrode {turn} of the file, counting {'the same' if way == 1 else 'the other'} way "
            "round" for way, turn in found.placements[:_MOST_NAMED]]
    return ", or ".join(ways) + (" and others" if len(found.placements) > _MOST_NAMED else "")


def _outlined(found: Inspection) -> bool:
    return found.sensor is not None and found.sensor.body.has_outline


def _body(found: Inspection) -> str:
    return "skin of that outline" if _outlined(found) else "disc"


def _out_of_phase(found: Inspection) -> float:
    """Part of complex readings that their turn to one phase leaves out, 2-norms."""
    readings = found.recording.readings
    kept, whole = np.nansum(in_phase(readings) ** 2), np.nansum(np.abs(readings) ** 2)
    return float(np.sqrt(max(1 - kept / whole, 0.0)))


def _level(found: Inspection) -> float:
    """What is added to all readings, in their unit."""
    recording = found.recording
    rows = in_phase(recording.readings)[recording.untouched if recording.untouched.any() else slice(None)]
    frame = mean_frame(rows[:, np.setdiff1d(np.arange(rows.shape[1]), [*found.dead_readings, *found.not_taken])])
    return found.identified.level * float(np.sqrt(np.nanmean(frame**2)))


def _range(apart: Apart) -> str:
    if apart.compared == 1 or apart.least == apart.most:
        return percent(apart.together, 2)
    return f"{percent(apart.least, 2)} to {percent(apart.most, 2)} ({percent(apart.together, 3)} all together)"


def _apart(apart: Apart | None) -> dict[str, float] | None:
    return None if apart is None else asdict(apart)


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _listed(numbers: Index) -> str:
    """Numbers as runs: 0 to 5, 8."""
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    said = [f"{run[0]} to {run[-1]}" if len(run) > 1 else str(run[0]) for run in runs]
    return ", ".join(said[:_MOST_NAMED]) + (f" and {counted(len(said) - _MOST_NAMED, 'more run')}"
                                           if len(said) > _MOST_NAMED else "")
