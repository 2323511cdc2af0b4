"""The strip of small figures on the first page: every fitted kind of test, measured and fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from matcal.laws.deformation_modes import MODES
from reports.calibration.card_record import Record, Test
from reports.document import style
from reports.document.numerals import pascals
from reports.document.page import ReportFigure

# panels that one strip holds
_MOST = 4
_KINDS = (*MODES, "relaxation", "conductivity")
_STRAIN = {"shear": "γ (–)", "volumetric": "J (–)"}


def strip(record: Record) -> ReportFigure | None:
    """Data and fit of up to four kinds of test side by side; None where nothing was fitted."""
    kinds = [kind for kind in _KINDS if record.fitted(kind)]
    kinds = kinds if len(kinds) <= _MOST else [*kinds[:_MOST - 2], *kinds[-2:]]
    if not kinds:
        return None
    figure = style.sheet(42)
    for axes, kind in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        _draw(axes, kind, record.fitted(kind))
        axes.locator_params(axis="y", nbins=4)
    tests = [test for kind in kinds for test in record.fitted(kind)]
    caption = f"Measured (dots) and fitted (lines): {', '.join(test.label for test in tests)}."
    return ReportFigure("overview", figure, caption, {"overview": _table(tests)})


def _draw(axes: Axes, kind: str, tests: Sequence[Test]) -> None:
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
        style.label(axes, _STRAIN.get(kind, "Nominal strain (–)"), f"{name} ({unit})", kind)


def _table(tests: Sequence[Test]) -> pd.DataFrame:
    parts = [pd.DataFrame({"test": test.label, "strain": test.strain, "measured": test.value, "fitted": test.fitted,
                           "unit": "S/m" if test.kind == "conductivity" else "Pa"}) for test in tests]
    return pd.concat(parts, ignore_index=True)
