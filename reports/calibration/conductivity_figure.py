"""Figure of the skin's conductivity against strain, measured, fitted and extrapolated (paper, figure 6c)."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from matcal.laws.conductivity import Conductivity, conductivity
from matcal.record.bands import conductivity_at
from reports.calibration.card_record import Array, Test
from reports.document import style
from reports.document.numerals import interval, number, percent
from reports.document.page import ReportFigure

DEEPEST = -0.9  # compression to which every touch may drive the law


def conductivity_law(tests: Sequence[Test], law: Conductivity, errors: Sequence[float],
                     band: pd.DataFrame | None) -> ReportFigure:
    """Data and law over the fitted strains, and the law on to deep compression."""
    figure = style.sheet(64)
    panels = figure.subplot_mosaic([["near", "far"], ["residual", "far"]], height_ratios=[3, 1])
    near, far, residual = panels["near"], panels["far"], panels["residual"]
    data = {}
    for i, test in enumerate(tests):
        for axes in (near, far):
            axes.plot(test.strain, test.value, "o", color=style.INK, ms=2, mew=0, label="measured" if i == 0 else None)
        model = conductivity(law, test.strain)
        residual.plot(test.strain, test.value - model, "o", color=style.ACCENT, ms=1.6, mew=0)
        data[test.label] = pd.DataFrame({"strain": test.strain, "conductivity_S_per_m": test.value,
                                         "fit_conductivity_S_per_m": model})
    residual.axhline(0, color=style.GREY, lw=0.6)
    residual.sharex(near)
    near.tick_params(labelbottom=False)
    lo, hi = law.strain_range
    fitted = np.linspace(lo, hi, 120)
    extended, stopped = _extended(law, hi)
    for axes in (near, far):
        axes.plot(fitted, conductivity(law, fitted), color=style.ACCENT, label=law.kind)
    outside = extended[extended < lo]
    if outside.size:
        far.plot(outside, conductivity(law, outside), color=style.ACCENT, ls="--", label="extrapolated")
        data["conductivity_law"] = pd.DataFrame({"strain": extended,
                                                 "conductivity_S_per_m": conductivity(law, extended)})
    if band is not None:
        _draw_band(near, far, band, (lo, hi))
        data["conductivity_band"] = band
    style.label(near, "", "Conductivity (S/m)", "over the fitted strains")
    style.label(residual, "Nominal strain (–)", "Residual (S/m)")
    style.label(far, "Nominal strain, compression negative (–)", "Conductivity (S/m)", "on to compression")
    near.legend(loc="best")
    far.legend(loc="best")
    return ReportFigure("conductivity", figure, _caption(law, errors, extended, stopped, band), data)


def _draw_band(near: Axes, far: Axes, band: pd.DataFrame, span: tuple[float, float]) -> None:
    inside = band[(band["strain"] >= span[0] - 1e-6) & (band["strain"] <= span[1] + 1e-6)]
    for axes, rows in ((near, inside), (far, band)):
        axes.fill_between(rows["strain"], rows["conductivity_lo_S_per_m"], rows["conductivity_hi_S_per_m"],
                          color=style.ACCENT, alpha=0.2, lw=0, label="95 % band")


def _extended(law: Conductivity, hi: float) -> tuple[Array, bool]:
    """Strains from DEEPEST (or from where the law stops being positive) to the end of the fit."""
    strain = np.linspace(DEEPEST, hi, 400)
    for first in range(strain.size):
        try:
            conductivity(law, strain[first:])
        except ValueError:
            continue
        return strain[first:], first > 0
    return strain[:0], True


def _caption(law: Conductivity, errors: Sequence[float], extended: Array, stopped: bool,
             band: pd.DataFrame | None) -> str:
    lo, hi = law.strain_range
    ends = conductivity(law, np.array([lo, hi]))
    caption = (f"Conductivity: from {number(ends[0])} to {number(ends[1])} S/m over the fitted strains of "
               f"{interval(lo, hi)}; the {law.kind} law misses the data by {percent(max(errors))} (relative RMS).")
    if stopped:
        caption += f" It stops being positive below a strain of {number(extended[0])}: touches deeper than that fail."
    else:
        caption += (" Touches compress the skin's thickness, where nothing was measured: at "
                    f"{number(DEEPEST)} the law gives {number(float(conductivity(law, DEEPEST)))} S/m")
        caption += "." if band is None else f" (95 %: {interval(*conductivity_at(band, DEEPEST)[1:])})."
    return caption + (" No band is drawn: the card's folder holds none." if band is None else "")
