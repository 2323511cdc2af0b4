"""The calibration report, from a card and the folder that `matcal fit` wrote next to it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from matcal.card import MaterialCard, grouped, with_moduli
from matcal.laws.deformation_modes import MODES
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law
from matcal.record.cautions import cautions, relative_rms, tests
from reports.calibration import calibration_tables as tables_of
from reports.calibration import cycle_figures, mode_figures, posterior_figures, stability_figure, stress_figures
from reports.calibration import first_page as summary
from reports.calibration.card_record import Record, read_record, rows_where
from reports.calibration.card_verdict import verdict
from reports.calibration.conductivity_figure import conductivity_law
from reports.calibration.dynamic_figures import relaxing_otherwise
from reports.document import provenance
from reports.document.numerals import counted, number, typeset
from reports.document.page import Report, ReportFigure, Table, write_pdf
from reports.document.style import house

NOT_FITTED = {"law": "The card has no hyperelastic law: no stress-strain curve was fitted.",
              "prony": "The card has no Prony series: no relaxation test was fitted.",
              "conductivity": "The card has no conductivity law: no conductivity test was fitted."}
NO_TABLE = {"parameters": NOT_FITTED["law"],
            "tested": "The card holds no errors of fit: it was not written by matcal fit.",
            "files": "The card names no measurement files."}


def write(card_path: Path, out: Path) -> None:
    """Write the PDF of a card: data, fits, residuals, parameters, stability, provenance. InputFileError where the card
    cannot be used; ValueError where the folder of `out` is missing."""
    with house():
        write_pdf(report(card_path), out)


def report(card_path: Path, stated: stress_figures.StatedLaw | None = None) -> Report:
    """Everything that the template `calibration.typ` shows of a card; `stated` is drawn over its tests of stress."""
    record = read_record(card_path)
    card, absent = record.card, {}
    draws, why = posterior_figures.draws_of(card_path, card)
    if draws is None:
        absent["posterior"] = why
    plates = [*mode_figures.strip(record), *_mode_plates(record, absent, stated),
              *_relaxation_plates(record, absent, stated), *_skin_plates(record, absent),
              *_predicted_plates(record), *_cycle_plates(record)]
    if card.hyperfoam and len(tried := card.fit.get("orders", ())) > 1:
        plates.append(mode_figures.orders(tried, card.hyperfoam.mu_Pa.size))
    if (bands := record.tables.get("bands")) is not None:
        plates.append(mode_figures.every_mode(bands, _band_source(card)))
    plates += _stability_plates(card, absent)
    if draws is not None:
        plates.append(posterior_figures.derived(draws, card))
    footer = provenance.footer(_sources(record), provenance.seed_words(card.provenance.get("seed")))
    return Report("calibration", "Material calibration", _subtitle(card), footer, summary.findings(card), plates,
                  _tables(record, absent), absent, _prose(record), [typeset(s) for s in cautions(card)],
                  {"decisions": [(typeset(title), [*map(typeset, said)]) for title, said in grouped(card)]},
                  verdict(card))


def _sources(record: Record) -> list[provenance.Source]:
    files = [provenance.source(path) for path in record.files]
    name = f"{counted(len(files), 'file')} in {record.card.data}, hash of their hashes"
    card = provenance.source(record.path)
    return [replace(card, name=f"file {card.name}"), *([provenance.combined(name, files)] if files else [])]


def _subtitle(card: MaterialCard) -> str:
    date = str(card.provenance.get("date", "")).replace("T", " ").replace("+00:00", " UTC")
    data = " to synthetic data" if card.provenance.get("synthetic") else ""
    return f"Card “{card.name}”" + (f", fitted{data} on {date}" if date else "")


def _alone(card: MaterialCard) -> dict[str, Law]:
    """Mode -> the law fitted to it alone."""
    found = card.fit.get("cross_prediction", {})
    return {mode: law_of(card.law.name, [np.ravel(row[p.name]).tolist() for p in card.law.parameters])
            for mode, row in found.items() if card.law}


def _mode_plates(record: Record, absent: dict[str, str],
                 stated: stress_figures.StatedLaw | None) -> list[ReportFigure]:
    card = record.card
    if card.law is None:
        absent["modes"] = NOT_FITTED["law"]
        return []
    kinds = [kind for kind in MODES if record.fitted(kind)]
    if not kinds:
        absent["modes"] = record.missing or "The card's folder holds no fitted stress-strain curve."
    errors = card.fit.get("cross_prediction", {})
    law = with_moduli(card, "longterm") if card.prony is not None else card.law
    bands, plates = record.tables.get("bands"), []
    for kind in kinds:
        here = {mode: found["relative_rms"][kind] for mode, found in errors.items()}
        band = None if bands is None else rows_where(bands, bands["mode"] == kind)
        plates.append(stress_figures.mode(record.fitted(kind), law, card.prony, _alone(card),
                                          {"all": relative_rms(card, kind)} | here, band, _band_source(card),
                                          stated))
    return plates


def _band_source(card: MaterialCard) -> str:
    return "from the posterior" if card.posterior else "linearised about the fit"


def _predicted_plates(record: Record) -> list[ReportFigure]:
    tested = record.card.fit.get("predicted", ())
    return [stress_figures.predicted(f"predicted_{k}", row, record.tables[f"predicted_{k}"])
            for k, row in enumerate(tested, 1) if f"predicted_{k}" in record.tables]


def _cycle_plates(record: Record) -> list[ReportFigure]:
    tables = {stem.removesuffix("_cycles"): table for stem, table in record.tables.items() if stem.endswith("_cycles")}
    paths = [stem for stem in record.tables if stem.endswith("_path")]
    missed = record.card.fit.get("softening", {}).get("relative_rms", ())
    return [*(cycle_figures.path(stem, record.tables[stem], rms) for stem, rms in zip(paths, missed, strict=False)),
            *(cycle_figures.cycles(label, table, record.card.fit.get(label, {})) for label, table in tables.items()
              if len(table))]


def _relaxation_plates(record: Record, absent: dict[str, str],
                       stated: stress_figures.StatedLaw | None) -> list[ReportFigure]:
    card = record.card
    tests = [t for t in record.fitted("relaxation") if t.time_s is not None]
    if card.prony is None:
        absent["relaxation"] = NOT_FITTED["prony"]
    elif other := relaxing_otherwise(record):
        return other
    elif not tests:
        absent["relaxation"] = record.missing or "The card's folder holds no fitted relaxation test."
    else:
        errors = [card.fit[t.label]["relative_rms"] for t in tests]
        return [stress_figures.relaxing(tests, card.prony, errors, stated)]
    return []


def _skin_plates(record: Record, absent: dict[str, str]) -> list[ReportFigure]:
    card, tests = record.card, record.fitted("conductivity")
    if card.conductivity is None:
        absent["conductivity"] = NOT_FITTED["conductivity"]
    elif not tests:
        absent["conductivity"] = record.missing or "The card's folder holds no fitted conductivity test."
    else:
        errors = [card.fit[t.label]["relative_rms"] for t in tests]
        band = record.tables.get("conductivity_band")
        return [conductivity_law(tests, card.conductivity, errors, band)]
    return []


def _stability_plates(card: MaterialCard, absent: dict[str, str]) -> list[ReportFigure]:
    if card.stability and card.law is not None:
        records = card.fit.get("data_stability", ())
        return [stability_figure.ranges(card.stability, card.law.strain_range, records)]
    absent["stability"] = "The card holds no stability ranges; matcal check computes them."
    return []


def _tables(record: Record, absent: dict[str, str]) -> dict[str, Table]:
    card, fit = record.card, record.card.fit
    foam, series, skin = (law is not None for law in (card.law, card.prony, card.conductivity))
    crossed = next(iter(fit.get("cross_prediction", {}).values()), {})
    # name -> the table, and whether the card holds what it shows
    made: dict[str, tuple[Callable[[MaterialCard], Table], Any]] = {
        "parameters": (tables_of.parameters, foam or series),
        "results": (lambda _: summary.results(record), foam or series or skin),
        "softening": (tables_of.softening, card.softening is not None),
        "laws": (tables_of.laws, fit.get("laws")),
        "skin": (tables_of.skin, skin),
        "tested": (summary.tested, tests(card)),
        "recorded": (lambda _: summary.recorded(record), tests(card)),
        "cross": (tables_of.cross, crossed),
        "by_test": (tables_of.by_test, len(crossed.get("relative_rms_of", ())) > len(crossed.get("relative_rms", ()))),
        "predicted": (tables_of.predicted, fit.get("predicted")),
        "data_stability": (tables_of.data_stability, fit.get("data_stability")),
        "without_stability": (tables_of.stability_cost, fit.get("without_stability")),
        "replicates": (tables_of.replicates, any("stiffness_factor" in row for row in tests(card).values())),
        "next_specimen": (tables_of.next_specimen, fit.get("next_specimen")),
        "series_orders": (tables_of.series_orders, len(fit.get("prony", {}).get("orders", ())) > 1),
        "orders": (tables_of.orders, foam and fit.get("orders")),
        "unstable": (tables_of.stability, card.stability),
        "exports": (tables_of.exports, foam),
        "files": (tables_of.files, card.provenance.get("files"))}
    tables = {name: make(card) for name, (make, there) in made.items() if there}
    absent |= {name: why for name, why in NO_TABLE.items() if name not in tables}
    return tables


def _prose(record: Record) -> dict[str, Any]:
    card = record.card
    parts = (*NOT_FITTED, "hyperfoam", "softening")
    prose: dict[str, Any] = {part: "" for part in parts if getattr(card, part) is not None}
    if "prior" in card.posterior:
        prose["prior"] = typeset(f"Prior: {card.posterior['prior']}")
    if record.missing:
        prose["missing"] = record.missing
    prose["decisions"] = ("Every correction that was applied and every choice that was made, by test and by stage."
                          if card.provenance.get("decisions") else "The card records no decisions.")
    if versions := card.provenance.get("versions"):
        prose["versions"] = f"Fitted with {provenance.version_lines(versions)}."
    if cost := card.provenance.get("cpu_s"):
        spent = [f"{stage} {number(value)} s" for stage, value in cost.items() if value > 0.005]
        prose["cost"] = f"CPU time: {', '.join(spent) or 'under 5 ms'}."
    return prose
