"""The calibration report, from a card and the folder that `matcal fit` wrote beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matcal.card import MaterialCard, with_moduli
from matcal.draws import Draws
from matcal.hyperfoam import Hyperfoam
from matcal.modes import MODES
from reports import calibration_tables as tables_of
from reports import mechanics_plates, posterior_plates, provenance, skin_plates, stability_plates
from reports.card_record import Record, read_record
from reports.numerals import counted, interval, number, percent
from reports.page import Plate, Report, Table, write_pdf
from reports.style import house

NOT_FITTED = {"hyperfoam": "The card has no hyperfoam law: no stress-strain curve was fitted.",
              "prony": "The card has no Prony series: no relaxation test was fitted.",
              "conductivity": "The card has no conductivity law: no conductivity test was fitted."}


def write(card_path: Path, out: Path) -> None:
    """Write the PDF of a card: data, fits, residuals, parameters, stability, provenance.

    TestFileError where the card cannot be used; ValueError where the folder of `out` is missing.
    """
    with house():
        write_pdf(report(card_path), out)


def report(card_path: Path) -> Report:
    """Everything that the template `calibration.typ` shows of a card."""
    record = read_record(card_path)
    card, absent = record.card, {}
    draws, why = posterior_plates.draws_of(card_path, card)
    if draws is None:
        absent["posterior"] = why
    plates = [*_mode_plates(record, draws, absent), *_relaxation_plates(record, absent),
              *_skin_plates(record, draws, absent), *_stability_plates(card, absent),
              *([posterior_plates.derived(draws, card)] if draws is not None else [])]
    footer = provenance.footer(_sources(record), provenance.seed_words(card.provenance.get("seed")))
    return Report("calibration", "Material calibration", _subtitle(card), footer, _findings(card), plates,
                  _tables(card, absent), absent, _prose(record))


def _sources(record: Record) -> list[provenance.Source]:
    beside = [provenance.source(path) for path in record.files]
    name = f"{counted(len(beside), 'file')} in {record.card.data}, hash of their hashes"
    return [provenance.source(record.path), *([provenance.combined(name, beside)] if beside else [])]


def _subtitle(card: MaterialCard) -> str:
    date = card.provenance.get("date")
    data = " to synthetic data" if card.provenance.get("synthetic") else ""
    return f"Card “{card.name}”" + (f", fitted{data} {date}" if date else "")


def _alone(card: MaterialCard) -> dict[str, Hyperfoam]:
    """Mode -> the law fitted to it alone."""
    found = card.fit.get("cross_prediction", {})
    return {mode: Hyperfoam(law["mu_Pa"], law["alpha"], law["nu"], "longterm") for mode, law in found.items()}


def _mode_plates(record: Record, draws: Draws | None, absent: dict[str, str]) -> list[Plate]:
    card = record.card
    if card.hyperfoam is None:
        absent["modes"] = NOT_FITTED["hyperfoam"]
        return []
    kinds = [kind for kind in MODES if record.fitted(kind)]
    if not kinds:
        absent["modes"] = record.missing or "The card's folder holds no fitted stress-strain curve."
    errors = card.fit.get("cross_prediction", {})
    law = with_moduli(card, "longterm") if card.prony is not None else card.hyperfoam
    plates = []
    for kind in kinds:
        tests = record.fitted(kind)
        span = min(float(t.strain.min()) for t in tests), max(float(t.strain.max()) for t in tests)
        band = posterior_plates.stress(draws, kind, *span) if draws is not None else None
        here = {mode: found["relative_rms"][kind] for mode, found in errors.items()}
        plates.append(mechanics_plates.mode(tests, law, card.prony, _alone(card),
                                            {"all": tables_of.relative_rms(card, kind)} | here, band))
    return plates


def _relaxation_plates(record: Record, absent: dict[str, str]) -> list[Plate]:
    card = record.card
    tests = [t for t in record.fitted("relaxation") if t.time_s is not None]
    if card.prony is None:
        absent["relaxation"] = NOT_FITTED["prony"]
    elif not tests:
        absent["relaxation"] = record.missing or "The card's folder holds no fitted relaxation test."
    else:
        return [mechanics_plates.relaxing(tests, card.prony, [card.fit[t.label]["relative_rms"] for t in tests])]
    return []


def _skin_plates(record: Record, draws: Draws | None, absent: dict[str, str]) -> list[Plate]:
    card, tests = record.card, record.fitted("conductivity")
    if card.conductivity is None:
        absent["conductivity"] = NOT_FITTED["conductivity"]
    elif not tests:
        absent["conductivity"] = record.missing or "The card's folder holds no fitted conductivity test."
    else:
        errors = [card.fit[t.label]["relative_rms"] for t in tests]
        span = skin_plates.DEEPEST, card.conductivity.strain_range[1]
        band = posterior_plates.conductivity(draws, *span) if draws is not None else None
        return [skin_plates.conductivity_law(tests, card.conductivity, errors, band)]
    return []


def _stability_plates(card: MaterialCard, absent: dict[str, str]) -> list[Plate]:
    if card.stability and card.hyperfoam is not None:
        return [stability_plates.ranges(card.stability, card.hyperfoam.strain_range)]
    absent["stability"] = "The card holds no stability ranges; `matcal check` computes them."
    return []


def _tables(card: MaterialCard, absent: dict[str, str]) -> dict[str, Table]:
    tables: dict[str, Table] = {}
    if card.hyperfoam is not None:
        tables["derived"] = tables_of.derived(card)
    if card.hyperfoam is not None or card.prony is not None:
        tables["parameters"] = tables_of.parameters(card)
    else:
        absent["parameters"] = NOT_FITTED["hyperfoam"]
    if card.conductivity is not None:
        tables["skin"] = tables_of.skin(card)
    if any(isinstance(row, Mapping) and "relative_rms" in row for row in card.fit.values()):
        tables["goodness"] = tables_of.goodness(card)
    else:
        absent["goodness"] = "The card holds no errors of fit: it was not written by `matcal fit`."
    if card.fit.get("cross_prediction"):
        tables["cross"] = tables_of.cross(card)
    if card.hyperfoam is not None and card.fit.get("orders"):
        tables["orders"] = tables_of.orders(card)
    if card.stability:
        tables["stability"] = tables_of.stability(card.stability)
    if card.provenance.get("files"):
        tables["files"] = tables_of.files(card.provenance)
    else:
        absent["files"] = "The card names no measurement files."
    return tables


def _findings(card: MaterialCard) -> list[str]:
    found = []
    if card.hyperfoam is not None:
        found += [_modulus_finding(card), *_fit_findings(card), *_stability_findings(card)]
    if card.prony is not None:
        found.append(f"Held at constant strain the stress relaxes by {percent(1 - card.prony.g_infinity, 3)}, with "
                     f"times of {', '.join(number(t) for t in card.prony.tau_s)} s.")
    if card.conductivity is not None:
        law = card.conductivity
        found.append(f"The skin conducts {number(law.c0_S_per_m)} S/m unstrained; measured for strains of "
                     f"{interval(*law.strain_range)}, everything beyond is extrapolated.")
    return found or ["The card is empty: nothing was fitted."]


def _modulus_finding(card: MaterialCard) -> str:
    assert card.hyperfoam is not None
    known = card.fit.get("derived", {}).get("mu_0_Pa")
    ends = f" (95 %: {interval(known['lo'] / 1e3, known['hi'] / 1e3)})" if known else ""
    return (f"Initial shear modulus μ₀ = {number(card.hyperfoam.mu_0_Pa / 1e3)} kPa{ends}, "
            f"{card.hyperfoam.moduli.replace('longterm', 'long-term')}, from {card.hyperfoam.mu_Pa.size} terms.")


def _fit_findings(card: MaterialCard) -> list[str]:
    kinds = [kind for kind in MODES if any(isinstance(r, Mapping) and r.get("kind") == kind for r in card.fit.values())]
    errors = [f"{percent(tables_of.relative_rms(card, kind))} in {kind}" for kind in kinds]
    return [f"The law misses the data by {', '.join(errors)} (relative RMS)."] if errors else []


def _stability_findings(card: MaterialCard) -> list[str]:
    assert card.hyperfoam is not None
    if not card.stability:
        return []
    lost = [f"{stability_plates.NAMES.get(c, c)} in {mode} at {interval(a, b)}" for c, modes in card.stability.items()
            for mode, row in modes.items() for a, b in row["unstable_strain"]
            if stability_plates.inside(mode, a, b, card.hyperfoam.strain_range)]
    return ["Inside the fitted strains stability is lost: " + "; ".join(lost) + "." if lost else
            "The law is stable at all fitted strains."]


def _prose(record: Record) -> dict[str, Any]:
    card, prose = record.card, {}
    for part in ("hyperfoam", "prony", "conductivity"):
        if getattr(card, part) is not None:
            prose[part] = ""
    if "prior" in card.posterior:
        prose["prior"] = f"Prior: {card.posterior['prior']}"
    if record.missing:
        prose["missing"] = record.missing
    prose["decisions"] = list(card.provenance.get("decisions", [])) or ["The card records no decisions."]
    if versions := card.provenance.get("versions"):
        prose["versions"] = f"Fitted with {provenance.version_lines(versions)}."
    if cost := card.provenance.get("cpu_s"):
        prose["cost"] = "CPU time: " + ", ".join(f"{stage} {number(value)} s" for stage, value in cost.items()) + "."
    return prose
