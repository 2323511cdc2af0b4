"""Figures over all tests: the strip of the first page, stress in every mode with its band, the orders tried."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from matcal.laws.deformation_modes import MODES
from reports.calibration.card_record import Record, Test, rows_where
from reports.calibration.stress_figures import half_width
from reports.document import style
from reports.document.numerals import number, pascals, percent
from reports.document.page import ReportFigure

STRAIN = {"shear": "γ (–)", "volumetric": "J (–)"}
KINDS = (*MODES, "relaxation", "conductivity")
MOST = 4  # panels that the strip holds


def strip(record: Record) -> list[ReportFigure]:
    """Data and fit of up to four kinds of test side by side; none where nothing was fitted."""
    kinds = [kind for kind in KINDS if record.fitted(kind)]
    kinds = kinds if len(kinds) <= MOST else [*kinds[:MOST - 2], *kinds[-2:]]
    if not kinds:
        return []
    figure = style.sheet(42)
    for axes, kind in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        _draw_tests(axes, kind, record.fitted(kind))
        axes.locator_params(axis="y", nbins=4)
    tests = [test for kind in kinds for test in record.fitted(kind)]
    caption = f"Measured (dots) and fitted (lines): {', '.join(test.label for test in tests)}."
    parts = [pd.DataFrame({"test": test.label, "strain": test.strain, "measured": test.value, "fitted": test.fitted,
                           "unit": "S/m" if test.kind == "conductivity" else "Pa"}) for test in tests]
    return [ReportFigure("overview", figure, caption, {"overview": pd.concat(parts, ignore_index=True)})]


def _draw_tests(axes: Axes, kind: str, tests: Sequence[Test]) -> None:
    factor, unit = (1.0, "S/m") if kind == "conductivity" else pascals(np.concatenate([t.value for t in tests]))
    name = "Conductivity" if kind == "conductivity" else "Stress"
    for test in tests:
        at = test.strain if kind != "relaxation" or test.time_s is None else test.time_s
        seen = at > 0 if kind == "relaxation" else np.full(at.size, True)
        axes.plot(at[seen], factor * test.value[seen], "o", color=style.INK, ms=1.6, mew=0)
        if test.fitted is not None:
            axes.plot(at[seen], factor * test.fitted[seen], color=style.ACCENT, lw=0.9)
    if kind == "relaxation":
        axes.set_xscale("log")
        axes.set_xlim(left=max(1e-2, axes.get_xlim()[0]))
        style.label(axes, "Time (s)", f"{name} ({unit})", kind)
    else:
        axes.locator_params(axis="x", nbins=4)
        style.label(axes, STRAIN.get(kind, "Nominal strain (–)"), f"{name} ({unit})", kind)


def every_mode(bands: pd.DataFrame, source: str) -> ReportFigure:
    """Long-term stress in all five modes, fitted strains drawn through, extrapolated ones dashed, with 95 % bands."""
    modes = [mode for mode in MODES if mode in set(bands["mode"])]
    figure = style.sheet(74)
    panels = figure.subplots(2, 3)
    for axes, mode in zip(panels.flat, modes, strict=False):
        _draw_mode(axes, rows_where(bands, bands["mode"] == mode), mode)
    for axes in list(panels.flat)[len(modes):]:
        axes.axis("off")
    legend = [Line2D([], [], color=style.ACCENT, label="fitted"),
              Line2D([], [], color=style.SECOND, ls="--", label="extrapolated"),
              Patch(color=style.ACCENT, alpha=0.2, label="95 % band")]
    panels.flat[-1].legend(handles=legend, loc="center")
    return ReportFigure("bands", figure, _bands_caption(bands, modes, source), {"bands": bands})


def _draw_mode(axes: Axes, rows: pd.DataFrame, mode: str) -> None:
    factor, unit = pascals(rows["stress_Pa"])
    fitted = rows["stress_Pa"].where(~rows["extrapolated"])
    for part, colour in ((~rows["extrapolated"], style.ACCENT), (rows["extrapolated"], style.SECOND)):
        axes.fill_between(rows["strain"], factor * rows["stress_lo_Pa"], factor * rows["stress_hi_Pa"],
                          where=part.to_numpy(), color=colour, alpha=0.2, lw=0)
    axes.plot(rows["strain"], factor * rows["stress_Pa"], color=style.SECOND, ls="--", lw=0.9)
    axes.plot(rows["strain"], factor * fitted, color=style.ACCENT, lw=1.3)
    stress = factor * rows["stress_Pa"].to_numpy()
    low, high = float(stress.min()), float(stress.max())
    axes.set_ylim(low - 0.15 * (high - low), high + 0.15 * (high - low))
    style.label(axes, STRAIN.get(mode, "Nominal strain (–)"), f"Stress ({unit})", mode)


def _bands_caption(bands: pd.DataFrame, modes: Sequence[str], source: str) -> str:
    said = []
    for mode in modes:
        rows = rows_where(bands, bands["mode"] == mode)
        known = rows_where(rows, ~rows["extrapolated"])
        use = known if len(known) > 1 else rows
        said.append(f"{mode} ± {percent(half_width(use))}" + ("" if len(known) > 1 else " (not fitted)"))
    return (f"Stress in every mode, long-term, with its 95 % band {source}. Widest half band over the largest stress: "
            f"{', '.join(said)}. Dashed: never measured; the band there holds only if the law does.")


def orders(tried: Sequence[Mapping[str, Any]], chosen: int) -> ReportFigure:
    """Residual and Bayesian information criterion against the number of terms."""
    table = pd.DataFrame([{"terms": row["order"], "residual": row["rms"], "bic": row["bic"],
                           "confluent": bool(row["confluence"])} for row in tried])
    table["bic_above_least"] = table["bic"] - table["bic"].min()
    figure = style.sheet(72, style.HALF_WIDTH_MM)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for axes, values in ((upper, 100 * table["residual"]), (lower, table["bic_above_least"])):
        axes.plot(table["terms"], values, "-", color=style.GREY, lw=0.8)
        for merged, fill in ((False, style.ACCENT), (True, "white")):
            own = table["confluent"] == merged
            axes.plot(table["terms"][own], values[own], "o", mfc=fill, mec=style.ACCENT, ms=4.5,
                      label="single terms merge" if merged else "single terms distinct")
        at = table["terms"] == chosen
        axes.plot(table["terms"][at], values[at], "o", mfc="none", mec=style.SECOND, ms=9, mew=1.2, label="chosen")
        axes.set_xticks(table["terms"])
        axes.margins(x=0.12, y=0.15)
    upper.set_yscale("log")
    style.plain_log(upper.yaxis)
    lower.set_yscale("symlog", linthresh=10)
    style.label(upper, "", "Weighted residual (%)")
    style.label(lower, "Terms of the law (–)", "BIC above the least (–)")
    upper.legend(loc="best")
    return ReportFigure("orders", figure, _orders_caption(table, chosen), {"orders": table})


def _orders_caption(table: pd.DataFrame, chosen: int) -> str:
    row = table[table["terms"] == chosen].iloc[0]
    others = rows_where(table, table["terms"] != chosen)
    best = others.iloc[int(np.argmin(others["bic"].to_numpy()))]
    gap = float(best["bic"] - row["bic"])
    return (f"Order of the law: {chosen} terms leave {percent(row['residual'], 3)}; the next best, "
            f"{int(best['terms'])} terms, leave {percent(best['residual'], 3)} and a BIC {number(abs(gap), 3)} "
            f"{'above' if gap >= 0 else 'below'} that of the law.")
