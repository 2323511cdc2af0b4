"""Figures of dynamic tests and of creep: the master curve with the shifts that made it, and the compliance."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from matcal.laws.histories.time_temperature import Shift, Wlf, decades
from matcal.laws.prony import Prony, relaxation
from reports.calibration.card_record import Record, rows_where
from reports.document import style
from reports.document.numerals import number, pascals, percent, prefixed
from reports.document.page import ReportFigure

ZERO_C = 273.15


def master_curve(table: pd.DataFrame, shift: Shift | None, found: Mapping[str, Any]) -> ReportFigure:
    """Storage and loss modulus, measured and of the series, over the frequency at the reference temperature; and
    log10 a_T of every sweep with its law."""
    figure = style.sheet(66)
    panels = figure.subplots(1, 2 if shift is not None else 1, squeeze=False)[0]
    table = table.sort_values("master_Hz")
    factor, unit = pascals(table["storage_Pa"].to_numpy(dtype=float))
    axes, data = panels[0], {"master_curve": table}
    for k, (name, words) in enumerate((("storage", "storage"), ("loss", "loss"))):
        axes.plot(table["master_Hz"], factor * table[f"{name}_Pa"], "o", color=style.SERIES[k], ms=1.8, mew=0,
                  label=words)
        axes.plot(table["master_Hz"], factor * table[f"fit_{name}_Pa"], color=style.SERIES[k], ls=style.DASHES[k],
                  label=f"{words}, series")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.legend(loc="best")
    style.label(axes, "Frequency (Hz)", f"Modulus ({unit})")
    rms = found.get("relative_rms", {})
    caption = (f"Dynamic test: the series misses the storage modulus by {percent(rms.get('storage', 0.0))} and the "
               f"loss modulus by {percent(rms.get('loss', 0.0))} (relative RMS).")
    if shift is not None and "shift" in found:
        data["shifts"] = _shifts(panels[1], shift, found["shift"])
        caption += _shift_words(shift, found["shift"])
    return ReportFigure("relaxation", figure, caption, data)


def _shifts(axes: Axes, shift: Shift, found: Mapping[str, Any]) -> pd.DataFrame:
    temperature = np.array(found["temperature_K"], dtype=float)
    log_a, sd = (np.array(found[name], dtype=float) for name in ("log10_a", "sd"))
    axes.errorbar(temperature - ZERO_C, log_a, 1.96 * sd, fmt="o", color=style.INK, ms=2.4, mew=0, lw=0.7,
                  label="sweeps, 95 %")
    fine = np.linspace(temperature.min(), temperature.max(), 200)
    axes.plot(fine - ZERO_C, decades(shift, fine), color=style.ACCENT,
              label="WLF" if isinstance(shift, Wlf) else "Arrhenius")
    axes.legend(loc="best")
    style.label(axes, "Temperature (°C)", "log$_{10}$ a$_T$ (–)")
    return pd.DataFrame({"temperature_K": temperature, "log10_a": log_a, "sd": sd,
                         "law_log10_a": decades(shift, temperature)})


def _shift_words(shift: Shift, found: Mapping[str, Any]) -> str:
    at = f"{number(shift.reference_K - ZERO_C)} °C"
    words = (f"WLF with C₁ = {number(shift.C1)} and C₂ = {number(shift.C2_K)} K" if isinstance(shift, Wlf) else
             f"Arrhenius with {number(shift.activation_J_per_mol / 1e3)} kJ/mol")
    return (f" Sweeps are shifted to {at}; {words} is {number(found['misfit_decades'])} decades off the shifts (rms).")


def creep(table: pd.DataFrame, prony: Prony, found: Mapping[str, Any]) -> ReportFigure:
    """Compliance over the time since the step, and the relaxation that follows from it."""
    figure = style.sheet(58)
    left, right = figure.subplots(1, 2)
    shown = rows_where(table, table["time_s"] > 0)
    factor, unit = prefixed(shown["compliance_1_per_Pa"].to_numpy(dtype=float), "/Pa")
    left.plot(shown["time_s"], factor * shown["compliance_1_per_Pa"], "o", color=style.INK, ms=1.8, mew=0,
              label="measured")
    left.plot(shown["time_s"], factor * shown["fit_compliance_1_per_Pa"], color=style.ACCENT, label="series")
    time = shown["time_s"].to_numpy(dtype=float)
    right.plot(time, relaxation(prony, time), color=style.SECOND)
    for axes in (left, right):
        axes.set_xscale("log")
    left.legend(loc="best")
    style.label(left, "Time since the step (s)", f"Compliance ({unit})")
    style.label(right, "Time since a step of strain (s)", "G(t)/G$_0$ (–)")
    missed = percent(found.get("relative_rms", {}).get("compliance", 0.0))
    caption = (f"Creep: the series misses the compliance by {missed} "
               "(relative RMS); the relaxation follows from it exactly.")
    return ReportFigure("relaxation", figure, caption, {"creep": table})


def relaxing_otherwise(record: Record) -> list[ReportFigure]:
    """The figure of a card whose series is from a dynamic test or a creep; none for any other."""
    found = record.card.fit.get("prony", {})
    assert record.card.prony is not None
    for stem, table in record.tables.items():
        if stem.startswith("dma_"):
            return [master_curve(table, record.card.shift, found)]
        if stem.startswith("creep_"):
            return [creep(table, record.card.prony, found)]
    return []
