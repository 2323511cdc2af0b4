"""Figure of the strains at which a law is stable, by criterion and mode."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from matcal.record.cautions import NAMES, overlaps
from reports.document import style
from reports.document.numerals import interval
from reports.document.page import ReportFigure

_SHORT = {"drucker": "Drucker", "elliptic": "ellipticity"}
SCANNED, UNSTABLE = "#dcdcdc", style.SECOND
Ranges = Mapping[str, tuple[float, float]]


def ranges(stability: Mapping[str, Any], fitted: Ranges, records: Sequence[Mapping[str, Any]] = ()) -> ReportFigure:
    """Scanned strains as grey bars, unstable ones on top, fitted ones as a line, violations by the records as crosses.
    `stability` and `records` (fit.data_stability) as the card holds them."""
    rows = [(mode, criterion) for mode in next(iter(stability.values())) for criterion in stability]
    figure = style.sheet(18 + 3.6 * len(rows))
    axes = figure.subplots()
    lost = []
    for y, (mode, criterion) in enumerate(rows):
        found = stability[criterion][mode]
        lo, hi = found["scanned"]
        axes.barh(y, hi - lo, left=lo, height=0.62, color=SCANNED)
        for a, b in found["unstable_strain"]:
            axes.barh(y, b - a, left=a, height=0.62, facecolor=UNSTABLE, hatch="////", edgecolor="white", lw=0)
            lost.append((mode, criterion, a, b))
        if mode in fitted:
            axes.plot(fitted[mode], [y, y], color=style.INK, lw=1.6, solid_capstyle="butt")
        for record in records:
            if (record["test"].rsplit("_", 1)[0], record["criterion"]) == (mode, criterion):
                for a, b in record["violated_strain"]:
                    axes.plot([a, b], [y + 0.42, y + 0.42], "|-", color=style.THIRD, lw=1.4, ms=4)
    _finish(axes, rows, bool(records))
    data = pd.DataFrame(lost, columns=["mode", "criterion", "unstable_from", "unstable_to"])
    return ReportFigure("stability", figure, _caption(lost, fitted), {"stability": data})


def _finish(axes: Axes, rows: Sequence[tuple[str, str]], checked: bool) -> None:
    axes.set_yticks(range(len(rows)), [f"{mode}, {_SHORT.get(criterion, criterion)}" for mode, criterion in rows])
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.axvline(0, color=style.GREY, lw=0.5)
    axes.legend(handles=[Patch(color=SCANNED, label="scanned"),
                         Patch(facecolor=UNSTABLE, hatch="////", edgecolor="white", label="unstable"),
                         Line2D([], [], color=style.INK, lw=1.6, label="fitted"),
                         *([Line2D([], [], color=style.THIRD, marker="|", ms=4, label="violated by the record itself")]
                           if checked else [])],
                loc="lower right", bbox_to_anchor=(1, 1), ncols=4)
    style.label(axes, "Nominal strain; γ in shear, J in volumetric (–)", "")


def _caption(lost: Sequence[tuple[str, str, float, float]], fitted: Ranges) -> str:
    if not lost:
        return "The law is stable at every scanned strain, by every criterion."
    within = [f"{NAMES.get(c, c)} in {mode} ({interval(a, b)})" for mode, c, a, b in lost
              if mode in fitted and overlaps((a, b), fitted[mode])]
    if within:
        return "Stability is lost inside the fitted strains: " + "; ".join(within) + "."
    return f"Stability is lost in {len(lost)} scanned ranges, none of them inside the fitted strains."
