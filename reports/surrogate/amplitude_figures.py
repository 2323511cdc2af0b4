"""The signal's amplitude over force, one line a diameter, with the forces of its tops."""

from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
import pandas as pd

from reports.document import style
from reports.document.numerals import number
from reports.document.page import ReportFigure

NAME = "amplitude"
_LIGHTEST = 0.9  # Shade of the widest punch, from dark to light.


def plate(found: Mapping[str, Any]) -> ReportFigure:
    """RMS of the signal over force of `surrogate.forward_map.amplitude`."""
    figure, force, tables = style.sheet(70, 120), np.array(found["force_N"]), []
    axes = figure.subplots()
    shades = matplotlib.colormaps[style.SEQUENTIAL](np.linspace(0, _LIGHTEST, len(found["diameters"])))
    for one, shade in zip(found["diameters"], shades, strict=True):
        rms = 1e3 * np.array(one["rms_V"])
        axes.plot(force, rms, color=shade, label=f"{number(one['d_mm'])} mm")
        if one["peak_N"] is not None:
            axes.plot(one["peak_N"], np.interp(one["peak_N"], force, rms), "o", ms=4, color=style.SECOND)
        tables.append(pd.DataFrame({"d_mm": one["d_mm"], "F_N": force, "rms_mV": rms}))
    axes.set_ylim(bottom=0)
    axes.legend(title="punch")
    style.label(axes, "Force (N)", "RMS of the signal (mV)")
    return ReportFigure(NAME, figure, f"Signal over force, {number(found['radius_mm'])} mm from "
                        f"{found.get('centre', 'the centre')}: "
                        f"{in_words(found)}", {NAME: pd.concat(tables, ignore_index=True)})


def in_words(found: Mapping[str, Any]) -> str:
    """Where the signal has its first top, and between which forces F has two answers by amplitude."""
    turned = [one for one in found["diameters"] if one["peak_N"] is not None]
    if not turned:
        return "it grows with the force at every diameter."
    peaks = ", ".join(f"{number(one['peak_N'], 2)} N at {number(one['d_mm'])} mm" for one in turned)
    low, high = min(turned, key=lambda one: one["d_mm"])["two_answers_N"]
    return (f"it has a top at {peaks} (dots) and falls for heavier touches, so that by amplitude F has two answers "
            f"around a top, as between {number(low, 2)} and {number(high, 2)} N at the smallest of these diameters.")
