"""Predictions against targets, training and unseen rows side by side (paper, figures 13 to 19)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from reports.document import style
from reports.document.numerals import counted, in_figure, number, percent, r_squared
from reports.document.page import ReportFigure

NAMES = {"x0": "Position x", "y0": "Position y", "d": "Punch diameter", "F": "Force", "sigma_max": "Peak pressure",
         "sigma_ave": "Mean pressure", "A_c": "Contact area", "delta_max": "Depth"}
# bars that a panel can show separately
BARS = 40
MANY = 200  # rows above which points are small
FEW_TARGETS = 12  # values of the targets up to which points are shifted sideways, so that they do not hide each other
TITLES = {"train": "training rows", "val": "validation rows", "test": "test rows", "new": "new rows", "all": "all rows"}


def label(name: str) -> str:
    """What an output is called on a page."""
    return NAMES.get(name, name)


def unseen(parts: Mapping[str, Any]) -> str:
    """The part of the rows that the model has not seen: its test rows, or those of another data set."""
    return next(part for part in ("test", "new", "all", "val", "train") if part in parts)


def unit(parts: Mapping[str, Any]) -> str:
    """Unit of an output as printed, from its scores."""
    return next(iter(parts.values()))["unit"].replace("2", "²")


def points(predictions: pd.DataFrame, name: str) -> pd.DataFrame:
    """The rows of one output: part, scene, target, value, half_width_90."""
    return pd.DataFrame(predictions.loc[predictions["output"] == name])


def correlations(rows: pd.DataFrame) -> dict[str, float]:
    """Part -> Pearson's correlation R of target and value of one output, what MATLAB's regression plot prints; parts
    where either does not vary are left out."""
    pairs = {str(part): own[["target", "value"]].to_numpy(dtype=float) for part, own in rows.groupby("part")}
    return {part: float(np.corrcoef(pair.T)[0, 1]) for part, pair in pairs.items() if np.ptp(pair, axis=0).min() > 0}


def plate(name: str, rows: pd.DataFrame, parts: Mapping[str, Any], by: str = "",
          title: str | None = None) -> ReportFigure:
    """Value over target of one output with its 90 % intervals; `parts` are its scores, `by` may say what predicted it,
    as " by the networks", `title` what it is, where not what it is called on a page."""
    title, sign, correlation = title or label(name), unit(parts), correlations(rows)
    shown = [part for part in ("train", "test") if part in parts] or list(parts)
    figure = style.sheet(42, style.HALF_WIDTH_MM if len(shown) < 3 else style.TEXT_WIDTH_MM)
    panels = figure.subplots(1, len(shown), sharex=True, sharey=True, squeeze=False)[0]
    places = rows.loc[rows["part"].isin(shown), ["target", "value"]].to_numpy(dtype=float)
    ends = float(places.min()), float(places.max())
    for axes, part in zip(panels, shown, strict=True):
        chosen = rows.loc[rows["part"] == part]
        _scatter(axes, chosen[["target", "value", "half_width_90"]].to_numpy(dtype=float).T, ends)
        r2 = [] if parts[part]["r2"] is None else [f"R² {r_squared(parts[part]['r2'])}"]
        r = [f"R {r_squared(correlation[part])}"] if part in correlation else []
        words = "\n".join([f"RMSE {_in(sign, parts[part]['rmse'])}", ", ".join(r2 + r)]).strip()
        axes.text(0.03, 0.97, in_figure(words), transform=axes.transAxes,
                  va="top", zorder=4, fontsize=7, bbox={"facecolor": "white", "alpha": 0.85, "lw": 0, "pad": 1})
        style.label(axes, f"Target ({sign})", "", TITLES.get(part, part))
    style.label(panels[0], f"Target ({sign})", in_figure(f"{title}, predicted ({sign})"), panels[0].get_title("left"))
    panels[0].yaxis.label.set_size(7.5)  # the longest name fits the height
    kept = ["part", "scene", "unit", "target", "value", "half_width_90"]
    return ReportFigure(f"parity_{name}", figure, _caption(f"{title}, predicted{by}", sign, shown, parts),
                        {f"parity_{name}": rows.filter(items=kept)})


def _scatter(axes: Axes, drawn: np.ndarray, ends: Sequence[float]) -> None:
    """Rows of `drawn` are target, value and half width; `ends` are those of the targets and values of all panels."""
    target, value, half_width = drawn
    target = target + _jitter(target, ends)
    margin = 0.08 * (ends[1] - ends[0]) or 1.0
    axes.set_ylim(ends[0] - margin, ends[1] + margin)
    axes.plot(ends, ends, color=style.GREY, lw=0.7, zorder=1)
    barred = np.unique(np.linspace(0, target.size - 1, BARS).round().astype(int))
    axes.errorbar(target[barred], value[barred], yerr=half_width[barred], fmt="none", ecolor="#9cc6e0", elinewidth=0.6,
                  zorder=2)
    axes.plot(target, value, "o", ms=2 if target.size <= MANY else 1.4, color=style.ACCENT, mew=0, zorder=3)


def _jitter(target: np.ndarray, ends: Sequence[float]) -> np.ndarray:
    """Shifts that keep the rows of a few targets apart, the same at every drawing; none for targets of many values."""
    if np.unique(target).size > FEW_TARGETS:
        return np.zeros(target.size)
    return 0.02 * (ends[1] - ends[0]) * np.linspace(-1, 1, 7)[np.arange(target.size) % 7]


def _caption(predicted: str, sign: str, shown: list[str], parts: Mapping[str, Any]) -> str:
    said = [f"{TITLES.get(part, part)} MSE {_in(_squared(sign), parts[part]['mse'])}" for part in shown]
    last, most = parts[shown[-1]], max(parts[part]["n"] for part in shown)
    drawn = "bars, cut at the frame" if most <= BARS else f"bars of {BARS} rows a panel, cut at the frame"
    return (f"{predicted} against target: {'; '.join(said)}. The 90 % intervals ({drawn}) hold "
            f"{percent(last['coverage_90'])} of the {counted(last['n'], 'row')} on the right.")


def _in(sign: str, value: float) -> str:
    """A value with its unit, of which a number has none."""
    return number(value) if sign == "–" else f"{number(value)} {sign}"


def _squared(sign: str) -> str:
    return {"mm²": "mm⁴", "–": "–"}.get(sign, f"{sign}²")
