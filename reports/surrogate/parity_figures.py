"""Predictions against targets, training and unseen rows side by side (paper, figures 13 to 19)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from reports.document import style
from reports.document.numerals import counted, number, percent, r_squared
from reports.document.page import ReportFigure

NAMES = {"x0": "Position x", "y0": "Position y", "d": "Punch diameter", "F": "Force", "sigma_max": "Peak pressure",
         "sigma_ave": "Mean pressure", "A_c": "Contact area", "delta_max": "Depth"}
# bars that a panel can show separately
BARS = 200
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


def plate(name: str, rows: pd.DataFrame, parts: Mapping[str, Any], by: str = "") -> ReportFigure:
    """Value over target of one output with its 90 % intervals; `parts` are its scores, `by` may say what predicted it,
    as " by the networks"."""
    title, sign = label(name), unit(parts)
    shown = [part for part in ("train", "test") if part in parts] or list(parts)
    figure = style.sheet(48, 83 * len(shown) if len(shown) < 3 else style.TEXT_WIDTH_MM)
    panels = figure.subplots(1, len(shown), sharex=True, sharey=True, squeeze=False)[0]
    places = rows.loc[rows["part"].isin(shown), ["target", "value"]].to_numpy(dtype=float)
    ends = float(places.min()), float(places.max())
    for axes, part in zip(panels, shown, strict=True):
        chosen = rows.loc[rows["part"] == part]
        _scatter(axes, chosen[["target", "value", "half_width_90"]].to_numpy(dtype=float).T, ends)
        style.label(axes, f"{title}, target ({sign})", "", TITLES.get(part, part))
    style.label(panels[0], f"{title}, target ({sign})", f"{title}, predicted ({sign})", panels[0].get_title("left"))
    kept = ["part", "scene", "unit", "target", "value", "half_width_90"]
    return ReportFigure(f"parity_{name}", figure, _caption(f"{title}, predicted{by}", sign, shown, parts),
                        {f"parity_{name}": rows.filter(items=kept)})


def _scatter(axes: Axes, drawn: np.ndarray, ends: Sequence[float]) -> None:
    """Rows of `drawn` are target, value and half width; `ends` are those of the targets and values of all panels."""
    target, value, half_width = drawn
    margin = 0.08 * (ends[1] - ends[0]) or 1.0
    axes.set_ylim(ends[0] - margin, ends[1] + margin)
    axes.plot(ends, ends, color=style.GREY, lw=0.7, zorder=1)
    barred = np.unique(np.linspace(0, target.size - 1, BARS).round().astype(int))
    axes.errorbar(target[barred], value[barred], yerr=half_width[barred], fmt="none", ecolor="#9cc6e0", elinewidth=0.6,
                  zorder=2)
    axes.plot(target, value, "o", ms=2 if target.size <= BARS else 1.4, color=style.ACCENT, mew=0, zorder=3)


def _caption(predicted: str, sign: str, shown: list[str], parts: Mapping[str, Any]) -> str:
    said = []
    for part in shown:
        score = parts[part]
        r2 = "" if score["r2"] is None else f", R² {r_squared(score['r2'])}"
        said.append(f"{TITLES.get(part, part)} MSE {number(score['mse'])} {_squared(sign)}{r2}")
    last, most = parts[shown[-1]], max(parts[part]["n"] for part in shown)
    drawn = "bars, cut at the frame" if most <= BARS else f"bars of at most {BARS} rows a panel, cut at the frame"
    return (f"{predicted} against target: {'; '.join(said)}. The 90 % intervals ({drawn}) hold "
            f"{percent(last['coverage_90'])} of the {counted(last['n'], 'row')} on the right.")


def _squared(sign: str) -> str:
    return {"mm²": "mm⁴"}.get(sign, f"{sign}²")
