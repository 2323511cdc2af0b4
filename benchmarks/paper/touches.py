"""Figures of choices that the paper leaves open: the kind of hold (figure 9), the punch's conduction, the strain."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from eitsim.scene.scene import Punch, Skin
from reports.document import style
from reports.document.numerals import number, volts
from reports.document.page import ReportFigure
from reports.touch import reading_figures
from touchcal.arrays import Array

# drive pattern whose potentials are followed, as "an arbitrary pattern" in the paper
PATTERN = 0
STRAINS = {"normal": "through the thickness", "principal": "largest in plane", "areal": "areal"}
PUNCHES = {0: "insulated", 1: "conducting"}
CHOICE = ("skin_strain", "punch_conductor")  # columns of what was chosen


def taken(tables: Mapping[str, Any]) -> tuple[str, int]:
    """The strain that drives the skin and whether the punch conducts (0 or 1) in a scene or design of these tables."""
    skin, punch = tables.get("skin", {}), tables.get("punch", {})
    return (str(skin.get("strain", Skin().strain)), int(bool(punch.get("conductor", Punch().conductor))))


def in_words(strain: str, conductor: int) -> str:
    """A choice on a page."""
    return f"strain {STRAINS.get(strain, strain)}, {PUNCHES[conductor]} punch"


def course(result: Mapping[str, Any]) -> pd.DataFrame:
    """Time (s), mean pressure (kPa), force (N), depth (mm), and the voltage of each reading of PATTERN (V) of a hold's
    result, the end of loading first."""
    rows = [{"time_s": block["time_s"], "sigma_ave_kPa": block["sigma_ave_kPa"], "force_N": block["force_N"],
             "delta_max_mm": block["delta_max_mm"]}
            | {f"reading_{i}_V": value for i, value in enumerate(block["readings_V"][PATTERN])}
            for block in result["times"]]
    return pd.DataFrame(rows)


def followed(result: Mapping[str, Any]) -> str:
    """Column of the reading of PATTERN that the touch changes most."""
    signal = np.array(result["readings_V"], dtype=float) - np.array(result["baseline_V"], dtype=float)
    return f"reading_{int(np.nanargmax(np.abs(signal[PATTERN])))}_V"


def hold_words(result: Mapping[str, Any]) -> str:
    """What a hold keeps and how long its loading takes, in words."""
    hold = result["scene"]["hold"]
    loaded = f"over {number(hold['loading_s'])} s" if hold["loading_s"] else "at once"
    return f"{hold['control']} kept, loaded {loaded}"


def holds(name: str, results: Mapping[str, Mapping[str, Any]], left_over: float) -> ReportFigure:
    """Mean contact pressure and one potential of holds, by what is kept (paper, figure 9); `left_over` is the share of
    the pressure that the paper has left after 2 s."""
    found = {hold_words(result): course(result) for result in results.values()}
    reading = followed(next(iter(results.values())))
    factor, unit = volts(np.concatenate([rows[reading].to_numpy() for rows in found.values()]))
    figure = style.sheet(70)
    left, right = figure.subplots(1, 2)
    for k, (words, rows) in enumerate(found.items()):
        look: dict[str, Any] = {"color": style.SERIES[k], "ls": style.DASHES[k], "marker": "os^"[k], "ms": 3,
                                "label": words}
        left.plot(rows["time_s"], rows["sigma_ave_kPa"], **look)
        right.plot(rows["time_s"], factor * rows[reading], **look)
    first = next(iter(found.values()))
    left.axhline(left_over * first["sigma_ave_kPa"].iloc[0], color=style.GREY, lw=0.8, ls=":",
                 label="what the paper has left after 2 s")
    style.label(left, "Time from the end of loading (s)", "Mean contact pressure (kPa)")
    style.label(right, "Time from the end of loading (s)", f"Voltage ({unit})")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    number_of = reading.split("_")[1]
    said = [f"{words}, from {number(rows['sigma_ave_kPa'].iloc[0])} to "
            f"{number(rows['sigma_ave_kPa'].iloc[-1])} kPa and from "
            f"{number(factor * rows[reading].iloc[0], 5)} to {number(factor * rows[reading].iloc[-1], 5)} {unit}"
            for words, rows in found.items()]
    marked = ", ".join(f"{t:g}" for t in first["time_s"] if t > 0)
    caption = (f"Mean contact pressure (left) and the voltage of pattern {PATTERN}, reading {number_of} (right), at "
               f"{marked} s and at the end of loading: {'; '.join(said)}.")
    data = pd.concat([rows.assign(kept=words) for words, rows in found.items()], ignore_index=True)
    return ReportFigure(name, figure, caption, {name: data})


def choices(name: str, rows: pd.DataFrame, patterns: int, own: tuple[str, int]) -> ReportFigure:
    """Signals of one touch by the strain that drives the skin, under an insulated and a conducting punch; `own` is the
    choice of this report."""
    signals = {(row["skin_strain"], int(row["punch_conductor"])): signal_of(row).reshape(patterns, -1)
               for row in rows.to_dict("records")}
    pattern, _ = reading_figures.largest(next(iter(signals.values())))
    figure = style.sheet(56)
    panels = figure.subplots(1, len(STRAINS))
    for axes, (strain, words) in zip(panels, STRAINS.items(), strict=True):
        factor, unit = volts(np.concatenate([signals[strain, p][pattern] for p in PUNCHES]))
        for punch, title in PUNCHES.items():
            axes.plot(factor * signals[strain, punch][pattern], color=style.SERIES[punch], ls=style.DASHES[punch],
                      marker="os"[punch], label=title)
        style.label(axes, "Reading (–)", f"Signal ΔV ({unit})", words)
        axes.legend(title="punch", title_fontsize=7.5)
    sizes = {key: float(np.sqrt(np.nanmean(signal**2))) for key, signal in signals.items()}
    base = own if own in sizes else next(iter(sizes))
    said = ", ".join(f"{words} {number(sizes[strain, 0] / sizes[base], 2)} (insulated) and "
                     f"{number(sizes[strain, 1] / sizes[base], 2)} (conducting)" for strain, words in STRAINS.items())
    caption = (f"Signal of pattern {pattern} by the strain that drives the skin. RMS of all readings over that of "
               f"{in_words(*base)}: {said}. Each panel has its own scale.")
    table = pd.DataFrame({f"dV_V {strain}, {PUNCHES[punch]}": signal.ravel() for (strain, punch), signal
                          in signals.items()})
    return ReportFigure(name, figure, caption, {name: table})


def signal_of(row: Mapping[Any, Any]) -> Array:
    """(readings,) signal of a row of a data set, V."""
    columns = sorted(key for key in row if str(key).startswith("dv_"))
    return np.array([row[key] for key in columns], dtype=float)


def conducting_share(rows: pd.DataFrame, strain: str) -> float:
    """RMS of what a conducting punch changes of the signal over the RMS of the signal under an insulated one."""
    both = {int(row["punch_conductor"]): signal_of(row) for row in rows.to_dict("records")
            if row["skin_strain"] == strain}
    return float(np.sqrt(np.nanmean((both[1] - both[0]) ** 2) / np.nanmean(both[0] ** 2)))


def changed(rows: pd.DataFrame, column: str, at_s: float) -> float:
    """Relative change of a column of a hold's course from the end of loading to a time, %."""
    first, later = rows[column].iloc[0], rows.loc[np.isclose(rows["time_s"], at_s), column].iloc[0]
    return float(100 * (later / first - 1))


