"""What a test file holds, in words and numbers, before anything is reduced."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from matcal.readers import vendors
from matcal.readers.column_options import Selection
from matcal.readers.detect import read
from matcal.readers.recording import QUANTITIES, SIZES, Recording
from matcal.readers.specimens import specimens_of
from matcal.readers.units import si_factor
from matcal.reduction.hold_segments import find_holds
from matcal.reduction.load_frame import sign_of_load
from matcal.reduction.loading_doubts import ramp_speed
from matcal.reduction.stroke_segments import Stroke, find_stroke, with_smaller
from matcal.reduction.test_kind import decide_kind
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.number_words import counted


def inspect(path: Path | str, selection: Selection | None = None, kind: str | None = None) -> dict[str, Any]:
    """What a test file holds, before anything is reduced.

    Parameters
    ----------
    path
        A machine file or table, or the folder of the parts of one TestSuite test.
    selection
        Which columns mean what, where the file does not say (`matcal.readers.column_options.parse_selection`).
    kind
        Kind of test, where the user says it.

    Returns
    -------
    dict
        JSON values: layout, files, rows, first_line, specimens (rows of each, where several stand in one table), head,
        columns (name, unit, range in SI), specimen (its sizes), clock, blocks, motion, kind with the reason for it, and
        notes on what was decided in reading it. The `kind` of a file that does not tell it is None, and the reason says
        what to do.

    Raises
    ------
    InputFileError
        For a file that cannot be read.
    ValueError
        For an unknown kind.

    Examples
    --------
    >>> import matcal
    >>> found = matcal.inspect("data_raw/mts_uniaxial.txt")
    >>> found["layout"], found["kind"], list(found["columns"])
    ('mts_testsuite', 'uniaxial', ['displacement', 'force', 'time'])
    """
    whole = read(path, selection)
    specimens = specimens_of(whole)
    recording = specimens[0]
    out: dict[str, Any] = {"layout": recording.vendor, "files": [str(p) for p in recording.paths],
                           "rows": whole.rows, "first_line": recording.first_line}
    if len(specimens) > 1:
        out["specimens"] = {part.part: part.rows for part in specimens}
    if recording.metadata:
        out["head"] = dict(recording.metadata)
    out["columns"] = {quantity: {"name": recording.names[quantity], "unit": recording.units[quantity] or "-",
                                 "min": float(values.min()), "max": float(values.max()),
                                 "si_unit": QUANTITIES[quantity] or "-"}
                      for quantity, values in whole.columns.items()}
    if recording.properties:
        out["specimen"] = {f"{size}_{SIZES[size].replace('^', '')}": value
                           for size, value in recording.properties.items()}
    out |= _clock(recording) | _blocks(recording) | _motion(recording) | _kind(recording, kind)
    if said := [*whole.notes, *recording.cautions]:
        out["notes"] = said
    return out


def _clock(recording: Recording) -> dict[str, Any]:
    if "time" not in recording.columns or recording.rows < 2:
        return {}
    time = recording.columns["time"]
    return {"duration_s": float(time[-1] - time[0]), "interval_s": float(np.median(np.diff(time)))}


def _blocks(recording: Recording) -> dict[str, Any]:
    out: dict[str, Any] = {}
    if (block := recording.columns.get("block")) is not None:
        numbers, rows = np.unique(block, return_counts=True)
        out["blocks"] = {f"{number:g}": int(count) for number, count in zip(numbers, rows, strict=True)}
    if (cycle := recording.columns.get("cycle")) is not None:
        out["cycles"] = int(np.unique(cycle).size)
    return out


def _motion(recording: Recording) -> dict[str, Any]:
    if "displacement" not in recording.columns:
        return {}
    travel = recording.columns["displacement"]
    try:
        stroke = find_stroke(travel)
    except ValueError:
        return {"motion": f"none: the displacement stays at {np.median(travel) * 1e3:.4g} mm, as in a hold without its "
                          "ramp"}
    if "force" in recording.columns:
        force = recording.columns["force"]
        stroke = with_smaller(stroke, sign_of_load(stroke, force) * force)
    out = {"largest_travel_mm": float(stroke.travel.max() * 1e3), "loadings": stroke.loadings}
    if "time" in recording.columns and stroke.end > stroke.start:
        seconds = recording.columns["time"][stroke.end] - recording.columns["time"][stroke.start]
        span = stroke.travel[stroke.end] - stroke.travel[stroke.start]
        out["loading_speed_mm_per_min"] = float(span / seconds * 6e4) if seconds > 0 else None
        out |= _holds(recording.columns["time"], stroke)
    return out


def _holds(time: Array, stroke: Stroke) -> dict[str, Any]:
    """How often and how long the travel is held on the way to the end of the first loading, and the speed between."""
    if np.any(np.diff(time) < 0):
        return {}
    part = slice(stroke.start, stroke.end + 1)
    held = [(a, b) for a, b in find_holds(time[part], stroke.travel[part]) if b < stroke.end - stroke.start]
    if not held:
        return {}
    lengths = [float(time[part][b - 1] - time[part][a]) for a, b in held]
    return {"holds_on_the_way": len(held), "hold_s": float(np.median(lengths)),
            "ramp_speed_mm_per_min": 6e4 * ramp_speed(time[part], stroke.travel[part])}


def _kind(recording: Recording, given: str | None) -> dict[str, Any]:
    try:
        kind, why = decide_kind(given, [recording])
    except InputFileError as error:
        return {"kind": None, "kind_reason": error.problem}
    return {"kind": kind, "kind_reason": why}


def print_description(path: str, found: dict[str, Any]) -> None:
    """Print what `inspect` found: the layout, a table of the columns in the file's own units, temperatures in K,
    then one line each."""
    from rich.console import Console
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False)
    console.width = console.width if console.is_terminal or "COLUMNS" in os.environ else 120
    parts = f" in {len(found['files'])} parts" if len(found["files"]) > 1 else ""
    console.print(Text(path, style="bold"), soft_wrap=True)
    title = next(reader.title for reader in vendors.readers() if reader.name == found["layout"])
    console.print(f"  {title}, {found['rows']:,} rows{parts} from line {found['first_line']}")
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for name, side in (("quantity", "left"), ("column", "left"), ("from", "right"), ("to", "right"), ("unit", "left")):
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    for quantity, column in found["columns"].items():
        unit = column["si_unit" if quantity == "temperature" else "unit"]
        scale = si_factor(unit, quantity) or 1.0
        table.add_row(quantity, Text(column["name"]), f"{column['min'] / scale:.6g}", f"{column['max'] / scale:.6g}",
                      Text(unit))
    console.print(Padding(table, (1, 2), expand=False))
    facts = Table(box=None, padding=(0, 2, 0, 0), show_header=False)
    facts.add_column(style="dim", no_wrap=True)
    facts.add_column(overflow="fold")
    for name, sentence in _facts(found):
        facts.add_row(name, Text(sentence))
    console.print(Padding(facts, (0, 2, 1, 2), expand=False))


def _facts(found: dict[str, Any]) -> list[tuple[str, str]]:
    reason = found["kind_reason"]
    out = [("taken for", reason.partition(": ")[2] if found["kind"] else reason[:1].upper() + reason[1:])]
    if "specimens" in found:
        rows = [f"{name} ({count:,} rows)" for name, count in list(found["specimens"].items())[:8]]
        out.append(("specimens", f"{', '.join(rows)}{' ...' if len(found['specimens']) > 8 else ''}; clock and motion "
                                 "are those of the first"))
    if "specimen" in found:
        out.append(("specimen", ", ".join(_size(name, value) for name, value in found["specimen"].items())))
    if "duration_s" in found:
        out.append(("clock", f"{found['duration_s']:.6g} s, a sample every {found['interval_s']:.4g} s"))
    if "blocks" in found:
        rows = [f"{number} ({count:,} rows)" for number, count in list(found["blocks"].items())[:8]]
        out.append(("blocks", f"{', '.join(rows)}{' ...' if len(found['blocks']) > 8 else ''}"))
    if "cycles" in found:
        out.append(("cycles", f"{found['cycles']} by the file's own count"))
    if "loadings" in found:
        speed = found.get("loading_speed_mm_per_min")
        out.append(("motion", f"{found['largest_travel_mm']:.4g} mm of travel"
                              f"{f' at {speed:.3g} mm/min' if speed else ''}, {found['loadings']} "
                              f"loading{'s' if found['loadings'] != 1 else ''}"))
        if "holds_on_the_way" in found:
            held = counted(found["holds_on_the_way"], "time")
            out.append(("", f"no steady loading: held {held} on the way, for some {found['hold_s']:.3g} s, and at "
                            f"{found['ramp_speed_mm_per_min']:.3g} mm/min between"))
    elif "motion" in found:
        out.append(("motion", found["motion"]))
    head = [f"{key}: {value}" for key, value in found.get("head", {}).items()]
    notes = [note[:1].upper() + note[1:] for note in found.get("notes", ())]
    for name, lines in (("head", head[:24]), ("decided", notes)):
        out += [(name if k == 0 else "", line) for k, line in enumerate(lines)]
    return out


def _size(name: str, value: float) -> str:
    size, _, unit = name.rpartition("_")
    return f"{size} {value * 1e6:.6g} mm2" if unit == "m2" else f"{size} {value * 1e3:.6g} mm"
