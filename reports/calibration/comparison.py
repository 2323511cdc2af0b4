"""Two cards drawn over each other, with their differences in standard deviations."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from matcal.laws.conductivity import conductivity
from matcal.laws.deformation_modes import MODES, nominal_stress
from matcal.laws.prony import relaxation
from matcal.record.compare import APART, Difference, differences, names_of, table
from reports.calibration.calibration_tables import printed
from reports.calibration.card_record import Record, read_record, rows_where
from reports.calibration.first_page import NAMES
from reports.document import provenance, style
from reports.document.numerals import number, percent
from reports.document.page import Report, ReportFigure, write_pdf
from reports.document.style import house
from reports.document.verdict import GOOD, NOT_USABLE, USABLE, Verdict, real

TIMES_S = (1e-2, 1e3)  # over which relaxations are drawn
PANELS = 3  # in a row


def write(first: Path, second: Path, out: Path) -> None:
    """Write the PDF of two cards. InputFileError where one cannot be used; ValueError where they share nothing."""
    with house():
        write_pdf(report(first, second), out)


def report(first: Path, second: Path) -> Report:
    """Everything that the template `comparison.typ` shows of two cards."""
    records = read_record(first), read_record(second)
    one, other = (record.card for record in records)
    found = differences(one, other)
    names = names_of(first, second)
    footer = provenance.footer([provenance.source(first), provenance.source(second)], "no seed: nothing is drawn")
    said = [f"{_named(row)}: {percent(row.second / row.first - 1)}"
            + ("" if row.sds is None else f", {number(row.sds, 2)} standard deviations") for row in found if row.first]
    largest = max((abs(row.sds) for row in found if row.sds is not None), default=None)
    caption = "Differences of the second card from the first." + (
        "" if largest is None else f" The largest is {number(largest, 2)} standard deviations.")
    synthetic = any(card.provenance.get("synthetic") for card in (one, other))
    return Report("comparison", "Two cards compared", f"{names[0]} and {names[1]}", footer, said,
                  _plates(records, names), {"differences": printed(table(found, names), caption)},
                  verdict=[_verdict(found), *real("A real material", synthetic)])


def _verdict(found: Sequence[Difference]) -> Verdict:
    known = [row for row in found if row.sds is not None]
    if not known:
        return Verdict("The one in place of the other", USABLE, "the cards hold no standard deviations to judge by")
    worst = max(known, key=lambda row: abs(row.sds or 0.0))
    size = abs(worst.sds or 0.0)
    return Verdict("The one in place of the other", GOOD if size < APART else NOT_USABLE,
                   f"largest difference {number(size, 2)} standard deviations, in {_named(worst)}")


def _named(row: Difference) -> str:
    """A quantity as the calibration names it."""
    return NAMES.get(row.name, row.name)


def _plates(records: Sequence[Record], names: tuple[str, str]) -> list[ReportFigure]:
    """Curves of both cards over each other, one panel a mode, relaxation and conductivity."""
    cards = [record.card for record in records]
    kinds = [mode for mode in MODES if all(card.law for card in cards)]
    kinds += [kind for kind, part in (("relaxation", "prony"), ("conductivity", "conductivity"))
              if all(getattr(card, part) is not None for card in cards)]
    lines = -(-len(kinds) // PANELS)
    figure = style.sheet(10 + 36 * lines)
    panels = list(figure.subplots(lines, PANELS, squeeze=False).flat)
    drawn = [_curve(record, kind).assign(card=name, kind=kind) for kind in kinds
             for record, name in zip(records, names, strict=True)]
    for axes, kind in zip(panels, kinds, strict=False):
        _panel(axes, kind, [rows for rows in drawn if rows["kind"].iloc[0] == kind])
    for axes in panels[len(kinds):]:
        axes.axis("off")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    caption = (f"Curves of {names[0]} (through) and {names[1]} (dashed), with their 95 % bands where the folders hold "
               "them. Stresses as each card labels its moduli; compression is negative.")
    return [ReportFigure("curves", figure, caption, {"curves": pd.concat(drawn, ignore_index=True)})]


def _curve(record: Record, kind: str) -> pd.DataFrame:
    """Columns at, value, lo, hi (NaN without a band), SI."""
    card = record.card
    stem, value = ("conductivity_band", "conductivity") if kind == "conductivity" else ("bands", "stress")
    unit = "S_per_m" if kind == "conductivity" else "Pa"
    band = record.tables.get(stem) if kind != "relaxation" else None
    if band is not None:
        rows = band if kind == "conductivity" else rows_where(band, band["mode"] == kind)
        columns = {"at": "strain", "value": f"{value}_{unit}", "lo": f"{value}_lo_{unit}", "hi": f"{value}_hi_{unit}"}
        return pd.DataFrame({name: rows[column].to_numpy() for name, column in columns.items()})
    if kind == "relaxation" and card.prony is not None:
        at = np.geomspace(*TIMES_S, 200)
        values = relaxation(card.prony, at)
    elif kind == "conductivity" and card.conductivity is not None:
        at = np.linspace(*card.conductivity.strain_range, 100)
        values = conductivity(card.conductivity, at)
    else:
        assert card.law is not None
        default = {"shear": (0.0, 1.0), "volumetric": (0.5, 1.0)}.get(kind, (-0.5, 0.0))
        at = np.linspace(*card.law.strain_range.get(kind, default), 100)
        values = nominal_stress(card.law, kind, at)
    return pd.DataFrame({"at": at, "value": values, "lo": np.nan, "hi": np.nan})


def _panel(axes: Axes, kind: str, curves: Sequence[pd.DataFrame]) -> None:
    factor = 1e-3 if kind in MODES else 1.0
    for rows, colour, dash in zip(curves, style.SERIES, style.DASHES, strict=False):
        axes.fill_between(rows["at"], factor * rows["lo"], factor * rows["hi"], color=colour, alpha=0.2, lw=0)
        axes.plot(rows["at"], factor * rows["value"], color=colour, ls=dash, label=rows["card"].iloc[0])
    if kind == "relaxation":
        axes.set_xscale("log")
    x = {"shear": "γ (–)", "volumetric": "J (–)", "relaxation": "Time (s)"}.get(kind, "Nominal strain (–)")
    y = {"relaxation": "G/G$_0$ (–)", "conductivity": "Conductivity (S/m)"}.get(kind, "Stress (kPa)")
    style.label(axes, x, y, kind)
