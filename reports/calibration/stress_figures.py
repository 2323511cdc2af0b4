"""Figures of stress: each mode with its fits and residuals (paper, figures 3b and 4b), and the relaxation (5b)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from matcal.laws.deformation_modes import hereditary_stress, nominal_stress
from matcal.laws.law import Law, over
from matcal.laws.prony import Prony, relaxation
from reports.calibration.card_record import Array, Test, rows_where
from reports.document import style
from reports.document.numerals import number, pascals, percent
from reports.document.page import ReportFigure

STRAIN = {"shear": "Shear strain γ (–)", "volumetric": "Volume ratio J (–)"}
MARKS = ("o", "s", "^", "D", "v", "P")  # one mark a specimen
# look of a law that was stated elsewhere
_STATED: dict[str, Any] = {"color": style.SERIES[3], "lw": 0.9, "marker": "x", "ms": 3.2, "mew": 0.8, "zorder": 2.5}


@dataclass(frozen=True)
class StatedLaw:
    """A law that others stated, to be drawn over the data and the fit."""

    words: str  # whose it is, as "the paper's Table 1"
    foam: Law
    series: Prony


def along_history(law: Law, prony: Prony | None, test: Test) -> Array:
    """Stress of a long-term law along a test's own history, Pa: relaxing where there is a series and a clock."""
    if prony is None or test.time_s is None:
        return nominal_stress(law, test.kind, test.strain)
    fast = replace(over(law, prony.g_infinity), moduli="instantaneous")
    return hereditary_stress(fast, prony, test.kind, test.time_s, test.strain)


def mode(tests: Sequence[Test], law: Law, prony: Prony | None, alone: Mapping[str, Law],
         errors: Mapping[str, float], band: pd.DataFrame | None, source: str,
         stated: StatedLaw | None = None) -> ReportFigure:
    """One mode: data, the law of all modes with its band, the laws of single modes, residuals. `law` and `alone` (mode
    -> law) are long-term; `errors`: "all" or mode -> relative RMS in this mode; `band`: the mode's rows of
    bands.parquet, from `source` in words; `stated`: a law of others, drawn as it stands."""
    kind = tests[0].kind
    factor, unit = pascals(np.concatenate([test.value for test in tests]))
    figure = style.sheet(72, style.HALF_WIDTH_MM)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    data = _draw_tests(upper, tests, factor, "fitted to all modes" if alone else "fitted")
    fine_unit = _draw_residuals(lower, tests)
    for k, (name, other) in enumerate(alone.items()):
        for i, test in enumerate(tests):
            stress = along_history(other, prony, test)
            upper.plot(test.strain, factor * stress, color=style.SERIES[(k + 1) % 4], ls=style.DASHES[(k + 1) % 4],
                       zorder=1.9, label=f"fitted to {name} alone" if i == 0 else None)  # below the law of all modes
            data[test.label][f"{name}_alone_stress_Pa"] = stress
    data |= _draw_longterm(upper, kind, law, tests, factor, band)
    caption = _mode_caption(kind, tests, errors, prony, band, source)
    if stated is not None:
        data[f"{kind}_stated"] = _draw_stated(upper, kind, stated, law, tests, factor)
        caption += _stated_caption(stated, data[f"{kind}_stated"])
    _frame_data(upper, [factor * test.value for test in tests])
    for name in alone:
        _mark_ends(upper, tests[0].strain, factor * data[tests[0].label][f"{name}_alone_stress_Pa"].to_numpy())
    style.label(upper, "", f"Nominal stress ({unit})")
    style.label(lower, STRAIN.get(kind, "Nominal strain (–)"), f"Residual ({fine_unit})")
    upper.legend(loc="lower left", bbox_to_anchor=(-0.15, 1), ncols=2, borderaxespad=0.2, columnspacing=1.0)
    return ReportFigure(kind, figure, caption, data)


def predicted(name: str, row: Mapping[str, Any], table: pd.DataFrame) -> ReportFigure:
    """A test that was kept out of the fit, and what the laws say of it; `row` of the card's fit.predicted."""
    factor, unit = pascals(table["stress_Pa"].to_numpy())
    figure = style.sheet(62, style.HALF_WIDTH_MM)
    axes = figure.subplots()
    axes.plot(table["strain"], factor * table["stress_Pa"], "o", color=style.INK, ms=2, mew=0, label="measured")
    axes.plot(table["strain"], factor * table["predicted_stress_Pa"], color=style.ACCENT,
              label="predicted by the law of all modes")
    alone = [column for column in table if str(column).endswith("_alone_stress_Pa")]
    for k, column in enumerate(alone, 1):
        axes.plot(table["strain"], factor * table[column], color=style.SERIES[k % 4], ls=style.DASHES[k % 4],
                  label=f"by that of {str(column).removesuffix('_alone_stress_Pa')} alone")
    _frame_data(axes, [factor * table["stress_Pa"].to_numpy()])
    style.label(axes, STRAIN.get(row["kind"], "Nominal strain (–)"), f"Nominal stress ({unit})")
    axes.legend(loc="lower left", bbox_to_anchor=(-0.15, 1), ncols=1, borderaxespad=0.2)
    missed = [f"the law of all modes misses it by {percent(row['relative_rms']['combined'], 3)}"]
    missed += [f"that of {law} by {percent(share, 3)}" for law, share in row["relative_rms"].items()
               if law.endswith("alone")]
    caption = (f"Predicted, not fitted: {', '.join(row['source'])}, {row['kind']}: {'; '.join(missed)} "
               "(relative RMS).")
    return ReportFigure(name, figure, caption, {name: table})


def _draw_tests(axes: Axes, tests: Sequence[Test], factor: float, title: str) -> dict[str, pd.DataFrame]:
    data = {}
    for i, test in enumerate(tests):
        said = "measured" if len(tests) == 1 else f"measured, {test.label}"
        axes.plot(test.strain, factor * test.value, MARKS[i % len(MARKS)], color=style.INK, ms=2, mew=0,
                  alpha=1 - 0.5 * i / len(tests), label=said)
        data[test.label] = pd.DataFrame({"strain": test.strain, "stress_Pa": test.value})
        if test.fitted is not None:
            axes.plot(test.strain, factor * test.fitted, color=style.ACCENT,
                      label=title if i == 0 else None)
            data[test.label]["fit_stress_Pa"] = test.fitted
    return data


def _draw_residuals(axes: Axes, tests: Sequence[Test]) -> str:
    """Measured minus fitted; the unit in which they are drawn."""
    residuals = [test.value - test.fitted for test in tests if test.fitted is not None]
    factor, unit = pascals(np.concatenate(residuals) if residuals else [0.0])
    for i, test in enumerate(t for t in tests if t.fitted is not None):
        axes.plot(test.strain, factor * residuals[i], MARKS[i % len(MARKS)], color=style.ACCENT, ms=1.6,
                  mew=0, alpha=1 - 0.5 * i / len(tests))
    axes.axhline(0, color=style.GREY, lw=0.6)
    return unit


def _draw_longterm(axes: Axes, kind: str, law: Law, tests: Sequence[Test], factor: float,
                   band: pd.DataFrame | None) -> dict[str, pd.DataFrame]:
    lo, hi = min(t.strain.min() for t in tests), max(t.strain.max() for t in tests)
    strain = np.linspace(lo, hi, 200)
    axes.plot(strain, factor * nominal_stress(law, kind, strain), color=style.ACCENT, lw=0.8, ls="-.",
              label="long-term law")
    if band is None:
        return {}
    rows = rows_where(band, (band["strain"] >= lo - 1e-9) & (band["strain"] <= hi + 1e-9))
    axes.fill_between(rows["strain"], factor * rows["stress_lo_Pa"], factor * rows["stress_hi_Pa"],
                      color=style.ACCENT, alpha=0.2, lw=0, label="its 95 % band")
    return {f"{kind}_band": rows.drop(columns="mode")}


def _draw_stated(axes: Axes, kind: str, stated: StatedLaw, law: Law, tests: Sequence[Test],
                 factor: float) -> pd.DataFrame:
    """The stated law over the strains of the tests, next to the long-term law of all modes."""
    strain = np.linspace(min(t.strain.min() for t in tests), max(t.strain.max() for t in tests), 200)
    stress = nominal_stress(stated.foam, kind, strain)
    axes.plot(strain, factor * stress, markevery=20, label=stated.words, **_STATED)
    return pd.DataFrame({"strain": strain, "stated_stress_Pa": stress,
                         "longterm_stress_Pa": nominal_stress(law, kind, strain)})


def _stated_caption(stated: StatedLaw, rows: pd.DataFrame) -> str:
    theirs, ours = rows["stated_stress_Pa"].to_numpy(), rows["longterm_stress_Pa"].to_numpy()
    off = np.sqrt(np.mean((theirs - ours) ** 2) / np.mean(ours**2))
    return f" From the long-term law, {stated.words} is {percent(off)} off (relative RMS over these strains)."


def _frame_data(axes: Axes, values: Sequence[Array]) -> None:
    """Limits that hold the data; a law that runs away leaves the frame."""
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    margin = 0.08 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + 2.5 * margin)


def _mark_ends(axes: Axes, strain: Array, value: Array) -> None:
    """An arrowhead where a curve leaves the frame."""
    low, high = axes.get_ylim()
    outside = (value < low) | (value > high)
    for at in np.flatnonzero(outside[1:] & ~outside[:-1]) + 1 if strain[-1] > strain[0] else (
            np.flatnonzero(outside[:-1] & ~outside[1:])):
        above = value[at] > high
        axes.plot(strain[at], high if above else low, "^" if above else "v", color=style.INK, ms=4, clip_on=False)


def _mode_caption(kind: str, tests: Sequence[Test], errors: Mapping[str, float], prony: Prony | None,
                  band: pd.DataFrame | None, source: str) -> str:
    others = {name: error for name, error in errors.items() if name != "all"}
    to_all = " fitted to all modes" if others else ""
    said = [f"{kind.capitalize()}: the law{to_all} misses these data by {percent(errors['all'], 3)} (relative RMS)"]
    said += [f"fitted to {name} alone it misses them by {percent(error, 3)}" for name, error in others.items()]
    caption = "; ".join(said) + "."
    if prony is not None and all(test.time_s is not None for test in tests):
        caption += (" The fits follow the test's own rate through the Prony series; the long-term law is what is left "
                    "when everything has relaxed.")
    if band is None:
        return caption + " No band is drawn: the card's folder holds none."
    width = half_width(rows_where(band, ~band["extrapolated"]))
    return caption + f" The 95 % band, {source}, is at most ± {percent(width)} of the largest stress."


def half_width(rows: pd.DataFrame) -> float:
    """Widest half band over the largest stress, of rows of bands.parquet."""
    half = (rows["stress_hi_Pa"].to_numpy() - rows["stress_lo_Pa"].to_numpy()) / 2
    return float(half.max() / np.abs(rows["stress_Pa"].to_numpy()).max())


def relaxing(tests: Sequence[Test], prony: Prony, errors: Sequence[float],
             stated: StatedLaw | None = None) -> ReportFigure:
    """Stress over the stress of an ideal step, measured and fitted with the recorded ramp, against time; the series of
    a `stated` law as it stands."""
    figure = style.sheet(72, style.HALF_WIDTH_MM)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    data, ramps = {}, []
    for i, test in enumerate(tests):
        time, stress, model = test.history()
        unit, ramp = _step_stress(test, prony)
        ramps.append(ramp)
        seen = time > 0.02 * ramp
        time, value, fitted = time[seen], stress[seen] / unit, model[seen] / unit
        upper.plot(time, value, "o", color=style.INK, ms=2, mew=0, label="measured" if i == 0 else None)
        upper.plot(time, fitted, color=style.ACCENT, label="fitted with the recorded ramp" if i == 0 else None)
        hold = time >= ramp
        lower.plot(time[hold], 100 * (value - fitted)[hold], "o", color=style.ACCENT, ms=1.6, mew=0)
        data[test.label] = pd.DataFrame({"time_s": time, "normalised_stress": value, "fit_normalised_stress": fitted})
    last = max(float(test.history()[0][-1]) for test in tests)
    time = np.geomspace(0.02 * min(ramps), last, 300)
    upper.plot(time, relaxation(prony, time), color=style.SECOND, ls="--", label="G(t)/G$_0$ after an ideal step")
    theirs = ""
    if stated is not None:
        left = relaxation(stated.series, time)
        upper.plot(time, left, markevery=25, label=f"the same of {stated.words}", **_STATED)
        data["relaxation_stated"] = pd.DataFrame({"time_s": time, "stated_relaxation": left,
                                                  "fit_relaxation": relaxation(prony, time)})
        most = float(np.max(np.abs(left / relaxation(prony, time) - 1)))
        theirs = f" After an ideal step the series of {stated.words} is at most {percent(most)} off the fitted one."
    lower.axhline(0, color=style.GREY, lw=0.6)
    upper.set_xscale("log")
    upper.legend(loc="lower right")
    style.label(upper, "", "Normalised stress (–)")
    style.label(lower, "Time from the start of loading (s)", "Residual (%)")
    peak = max(float(np.max(data[test.label]["normalised_stress"])) for test in tests)
    caption = (f"Relaxation: the series misses the hold by {percent(max(errors))} (relative RMS). After a ramp of "
               f"{', '.join(number(r) for r in ramps)} s the stress peaks at {number(peak)} of that after an ideal "
               f"step, and {number(prony.g_infinity)} of it stays for good. Stress is normalised where fit and ideal "
               f"step meet, at the end of the hold.{theirs}")
    return ReportFigure("relaxation", figure, caption, data)


def _step_stress(test: Test, prony: Prony) -> tuple[float, float]:
    """Stress right after an ideal step, Pa, that would relax to the fit's last value; and the ramp time, s."""
    time, _, model = test.history()
    ramp = float(time[np.argmax(np.abs(test.strain) >= 0.999 * np.abs(test.strain).max())])
    return float(model[-1] / relaxation(prony, time[-1] - ramp / 2)), ramp
