"""What a test file holds, in words and numbers, before anything is reduced."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from matcal.errors import TestFileError
from matcal.kinds import decide_kind
from matcal.readers.detect import read
from matcal.readers.recording import QUANTITIES, Recording
from matcal.stroke import find_stroke


def describe(path: Path | str) -> dict[str, Any]:
    """Layout, parts, head, columns (name, unit, range in SI), clock, motion and kind of a test file, as JSON values.

    A file whose kind nothing tells still is described, its `kind` says what to do. Raises TestFileError for a file
    that cannot be read.
    """
    recording = read(path)
    out: dict[str, Any] = {"layout": recording.vendor, "files": [str(p) for p in recording.paths],
                           "rows": recording.rows, "first_line": recording.first_line}
    if recording.metadata:
        out["head"] = dict(recording.metadata)
    out["columns"] = {quantity: {"name": recording.names[quantity], "unit": recording.units[quantity] or "-",
                                 "min": float(values.min()), "max": float(values.max()),
                                 "si_unit": QUANTITIES[quantity] or "-"}
                      for quantity, values in recording.columns.items()}
    out |= _clock(recording) | _motion(recording) | _kind(recording)
    if recording.notes:
        out["notes"] = list(recording.notes)
    return out


def _clock(recording: Recording) -> dict[str, Any]:
    if "time" not in recording.columns or recording.rows < 2:
        return {}
    time = recording.columns["time"]
    return {"duration_s": float(time[-1] - time[0]), "interval_s": float(np.median(np.diff(time)))}


def _motion(recording: Recording) -> dict[str, Any]:
    if "displacement" not in recording.columns:
        return {}
    try:
        stroke = find_stroke(recording.columns["displacement"])
    except ValueError as error:
        return {"motion": f"{error}."}
    out = {"largest_travel_mm": float(stroke.travel.max() * 1e3), "loadings": stroke.loadings}
    if "time" in recording.columns and stroke.end > stroke.start:
        seconds = recording.columns["time"][stroke.end] - recording.columns["time"][stroke.start]
        span = stroke.travel[stroke.end] - stroke.travel[stroke.start]
        out["loading_speed_mm_per_min"] = float(span / seconds * 6e4) if seconds > 0 else None
    return out


def _kind(recording: Recording) -> dict[str, Any]:
    try:
        kind, why = decide_kind(None, [recording])
    except TestFileError as error:
        return {"kind": None, "kind_reason": error.problem}
    return {"kind": kind, "kind_reason": why}
