"""A held touch in a report: the time that its results stand for, and the table of all its times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reports.document.numerals import number, volts
from reports.document.page import Table

Array = NDArray[np.float64]


def when(result: Mapping[str, Any]) -> str:
    """The time that the results of a hold stand for, its last, in words; empty without a hold."""
    times = result.get("times", [])
    if not times:
        return ""
    last = times[-1]["time_s"]
    return f"after {number(last)} s" if last > 0 else "at the end of loading"


def table(times: Sequence[Mapping[str, Any]], baseline_V: Array) -> Table:
    """Force, depth, peak pressure and largest signal of a hold, a row a time; `times` of a result, baseline in V."""
    signals = [float(np.nanmax(np.abs(np.array(block["readings_V"], dtype=float) - baseline_V))) for block in times]
    factor, unit = volts(signals)
    keys = ("force_N", "delta_max_mm", "sigma_max_kPa")
    rows = [[number(block["time_s"]), *(number(block[key], 4) for key in keys), number(signal * factor)]
            for block, signal in zip(times, signals, strict=True)]
    first, last = times[0], times[-1]
    caption = "The hold, timed from the end of loading"
    if len(times) > 1:
        changes = [_change(name, first[key], last[key], unit_of) for name, key, unit_of in
                   (("force", "force_N", "N"), ("depth", "delta_max_mm", "mm"))]
        caption += f": {' and '.join(changes)}"
    caption += f". The other results in this report are those {when({'times': times})}."
    return Table(caption, ["time (s)", "force (N)", "depth (mm)", "peak pressure, facet average (kPa)",
                           f"largest signal ({unit})"], rows, "rrrrr")


def _change(name: str, first: float, last: float, unit: str) -> str:
    start, end = number(first, 4), number(last, 4)
    return (f"the {name} stays at {end} {unit}" if start == end else
            f"the {name} goes from {start} to {end} {unit}")
