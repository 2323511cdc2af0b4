"""Figure of resistance and displacement over time of a strip that is cycled (paper, figure 6b)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from matcal.readers.detect import read
from matcal.reduction.reduce import read_test
from matcal.reduction.stroke_segments import find_stroke
from reports.document import style
from reports.document.numerals import number, prefixed
from reports.document.page import ReportFigure

KIND = "conductivity"


def record(files: Sequence[Path], specimen: Path) -> pd.DataFrame:
    """time_s, resistance_Ohm and displacement_mm of a strip over the frame's record, at the potentiostat's samples.

    R = U/I by Ohm's law; the potentiostat's clock is set to the frame's by the shift that the reduction finds.
    InputFileError as `matcal.read_test`."""
    shift = read_test({KIND: list(files)}, specimen).facts["clock_shift_s"]
    frame, pot = (next(one for one in map(read, files) if quantity in one.columns)
                  for quantity in ("displacement", "current"))
    stroke, time = find_stroke(frame.columns["displacement"]), pot.columns["time"] - shift
    inside = (time >= frame.columns["time"][0]) & (time <= frame.columns["time"][-1])
    resistance = pot.columns["potential"] / pot.columns["current"]
    moved = np.interp(time, frame.columns["time"], stroke.travel)
    return pd.DataFrame({"time_s": time[inside], "resistance_Ohm": resistance[inside],
                         "displacement_mm": 1e3 * moved[inside]})


def over_time(name: str, rows: pd.DataFrame) -> ReportFigure:
    """Resistance, and below it the displacement, over time."""
    factor, unit = prefixed(rows["resistance_Ohm"].to_numpy(), "Ω")
    figure = style.sheet(58)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    upper.plot(rows["time_s"], factor * rows["resistance_Ohm"], color=style.ACCENT, lw=0.8)
    lower.plot(rows["time_s"], rows["displacement_mm"], color=style.SECOND, lw=0.8)
    style.label(upper, "", f"Resistance ({unit})")
    style.label(lower, "Time (s)", "Stretch (mm)")
    most, tenth = rows["displacement_mm"].to_numpy().max(), len(rows) // 10
    drawn = factor * rows["resistance_Ohm"].to_numpy()
    ends = drawn[:tenth].max(), drawn[-tenth:].max()
    caption = (f"Resistance under cycles of {number(most)} mm, and the displacement that is applied, over time: the "
               f"resistance peaks at {number(ends[0])} {unit} in the first tenth of the record and at "
               f"{number(ends[1])} {unit} in the last.")
    return ReportFigure(name, figure, caption, {name: rows})
