"""The first page of a calibration: what was found with its intervals, where it holds, what was tested."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from matcal.card import MaterialCard
from matcal.laws.conductivity import conductivity
from matcal.laws.deformation_modes import MODES, nominal_stress
from matcal.laws.law import Law
from matcal.record.bands import conductivity_at
from matcal.record.cautions import relative_rms, tests
from matcal.record.compare import quoted
from reports.calibration.card_record import Record, Test
from reports.document.numerals import counted, interval, number, pascals, percent, r_squared, within
from reports.document.page import Table

NAMES = {"mu_0_Pa": "initial shear modulus μ₀", "E_0_Pa": "initial Young's modulus E₀",
         "plateau_Pa": "plateau stress at 40 % strain", "g_infinity": "long-term share of the modulus",
         "c0_S_per_m": "unstrained conductivity c₀"}
PLATEAU_STRAIN = -0.4
_LISTED = 6  # relaxation times that are listed one by one
UNKNOWN = "not recorded"
# layout of a file -> whose program wrote it
MACHINES = {"mts_testsuite": "MTS TestSuite", "mts_793": "MTS 793", "instron": "Instron", "nova": "Autolab NOVA"}
SYMBOLS = {"shear": "γ", "volumetric": "J"}


def law_values(law: Law) -> dict[str, float]:
    """The derived quantities of a law, Pa, where the card holds none."""
    return {"mu_0_Pa": law.mu_0_Pa, "E_0_Pa": law.E_0_Pa,
            "plateau_Pa": -float(nominal_stress(law, "uniaxial", PLATEAU_STRAIN))}


def moduli(law: Law) -> str:
    """The label of the moduli, as a word."""
    return law.moduli.replace("longterm", "long-term")


def ranges(card: MaterialCard) -> str:
    """The strains fitted in each mode, in words."""
    fitted = card.law.strain_range if card.law else {}
    return ", ".join(f"{mode} {SYMBOLS.get(mode, '')} {interval(ends[0], ends[1])}".replace("  ", " ")
                     for mode, ends in fitted.items())


def results(record: Record) -> Table:
    """Every number that an engineer asks for first, with its 95 % interval and where it holds."""
    rows = [*_foam_rows(record.card), *_series_rows(record.card), *_skin_rows(record)]
    return Table(_caption(record.card), ["quantity", "unit", "value", "95 % interval", "holds for"], rows, "wlrrw")


def _caption(card: MaterialCard) -> str:
    known = [(row["hi"] - row["lo"]) / 2 / abs(row["value"]) for name in card.fit.get("derived", {})
             if (row := quoted(card, name)) and row["value"]]
    if not known:
        return "Results; the card holds no intervals." if card.law else "Results."
    source = "the posterior" if card.posterior.get("checks", {}).get("converged") else "the fit, linearised"
    about = f" {card.fit['intervals']}" if "intervals" in card.fit else ""
    return (f"Results: what the tests determine, the moduli to ± {percent(max(known))} or better. Values are those of "
            f"the card, intervals hold 95 % of {source}.{about}")


def _foam_rows(card: MaterialCard) -> list[list[str]]:
    law, rows = card.law, []
    if law is None:
        return rows
    known = card.fit.get("derived", {})
    factor, unit = pascals(law.mu_0_Pa)
    values = law_values(law) if not known else {name: row["value"] for name, row in known.items()}
    for name, value in values.items():
        middle, ends = _within(quoted(card, name), value, factor)
        rows.append([NAMES.get(name, name), unit, middle, ends, _where(card, name)])
    if (row := quoted(card, "mu_0_new_specimen_Pa")) is not None:
        middle, ends = within(factor * row["value"], factor * row["lo"], factor * row["hi"])
        rows.append(["μ₀ of a further specimen", unit, middle, ends, "specimens like those tested"])
    return rows


def _within(row: Mapping[str, float] | None, value: float, factor: float) -> tuple[str, str]:
    if row is None:
        return number(factor * value, 4), "not in the card"
    return within(factor * value, factor * row["lo"], factor * row["hi"])


def _where(card: MaterialCard, name: str) -> str:
    assert card.law is not None
    if name != "plateau_Pa":
        return f"small strain, {moduli(card.law)}"
    lo, hi = card.law.strain_range.get("uniaxial", (0.0, 0.0))
    inside = lo <= PLATEAU_STRAIN <= hi
    return f"uniaxial, {moduli(card.law)}" + ("" if inside else "; extrapolated")


def _own(card: MaterialCard, name: str, value: float, sd: float | None) -> tuple[str, str]:
    """A value of the card and its interval: as quoted, else from its standard error."""
    row = quoted(card, name) or ({"lo": value - 1.96 * sd, "hi": value + 1.96 * sd} if sd else None)
    return within(value, row["lo"], row["hi"]) if row else (number(value, 4), "not in the card")


def _series_rows(card: MaterialCard) -> list[list[str]]:
    if card.prony is None:
        return []
    found = card.fit.get("prony", {})
    middle, ends = _own(card, "g_infinity", card.prony.g_infinity, found.get("g_infinity_sd"))
    ends_s = [row["time_s"] for row in tests(card).values() if row["kind"] == "relaxation" and "time_s" in row]
    last = found["seen_s"][1] if "seen_s" in found else max(ends_s, default=None)
    rows = [[NAMES["g_infinity"], "–", middle, ends,
             f"{number(last)} s of relaxation" if last else "the recorded hold"]]
    for name, row in found.get("instantaneous", {}).items():
        sd = row["sd"]
        middle, ends = within(row["value"], row["value"] - 1.96 * sd, row["value"] + 1.96 * sd)
        rows.append([f"instantaneous modulus {name.removesuffix('_Pa').replace('_0', '₀')}", "Pa", middle, ends,
                     "before relaxation"])
    return rows


def _skin_rows(record: Record) -> list[list[str]]:
    card = record.card
    if card.conductivity is None:
        return []
    c0, (lo, hi) = card.conductivity.c0_S_per_m, card.conductivity.strain_range
    middle, ends = _own(card, "c0_S_per_m", c0, card.fit.get("conductivity", {}).get("c0_sd_S_per_m"))
    rows = [[NAMES["c0_S_per_m"], "S/m", middle, ends, f"strain {interval(lo, hi)}"]]
    band = record.tables.get("conductivity_band")
    if band is not None:
        value, low, high = conductivity_at(band, -0.5)
        middle, ends = within(value, low, high)
        rows.append(["conductivity at a strain of −0.5", "S/m", middle, ends,
                     "extrapolated" if lo > -0.5 else "measured"])
    return rows


def tested(card: MaterialCard) -> Table:
    """What was tested and how well it is met, one row a test."""
    found = tests(card)
    rows = [[label, ", ".join(row.get("source", [])), str(row["n"]),
             interval(*row["strain_range"]) if "strain_range" in row else "–", f"{number(row['rms'])} {row['unit']}",
             percent(row["relative_rms"]), "–" if row["r2"] is None else r_squared(row["r2"])]
            for label, row in found.items()]
    worst = max(found, key=lambda label: found[label]["relative_rms"])
    caption = (f"Tests and errors of fit: the largest relative RMS is {percent(found[worst]['relative_rms'])}, of "
               f"{worst}. Relative RMS is rms(residual)/rms(measured), of a relaxation over its holds.")
    return Table(caption, ["test", "file", "points", "strain", "RMS", "relative RMS", "R²"], rows, "lwrrrrr")


def recorded(record: Record) -> Table:
    """What a test report states of every test, as far as the record holds it."""
    rows = []
    for label, row in tests(record.card).items():
        same = sum(other["kind"] == row["kind"] for other in tests(record.card).values())
        rows.append([label, ", ".join(row.get("standards", ())) or UNKNOWN, _sizes(row),
                     _rate(record.tests.get(label)), _machines(row.get("layout")), str(same)])
    caption = ("What the record says of the tests. Machine model, operator, date, temperature and humidity are not "
               "recorded. Rate: largest strain over the time to reach it.")
    return Table(caption, ["test", "standard", "specimen", "rate (1/s)", "machine's program", "specimens"], rows,
                 "lwwrwr")


def _machines(layout: str | None) -> str:
    return ", ".join(MACHINES.get(name, name) for name in layout.split(", ")) if layout else UNKNOWN


def _sizes(row: Mapping[str, Any]) -> str:
    if "specimen_area_mm2" not in row:
        return UNKNOWN
    part = "coating ring of" if row["kind"] == "conductivity" else "loaded area"
    return f"{part} {number(row['specimen_area_mm2'])} mm², length {number(row['specimen_length_mm'])} mm"


def _rate(test: Test | None) -> str:
    if test is None or test.time_s is None:
        return UNKNOWN
    at = int(np.argmax(np.abs(test.strain) >= 0.999 * np.abs(test.strain).max()))
    spent = float(test.time_s[at] - test.time_s[0])
    return number(abs(float(test.strain[at] - test.strain[0])) / spent, 2) if spent > 0 else UNKNOWN


def findings(card: MaterialCard) -> list[str]:
    """The card in a few sentences."""
    found = [*_foam_findings(card), *_series_findings(card), *_skin_findings(card)]
    return found or ["The card is empty: nothing was fitted."]


def _foam_findings(card: MaterialCard) -> list[str]:
    if card.law is None:
        return []
    law, known = card.law, quoted(card, "mu_0_Pa")
    factor, unit = pascals(law.mu_0_Pa)
    middle, ends = _within(known, law.mu_0_Pa, factor)
    terms = f" of {counted(card.hyperfoam.mu_Pa.size, 'term')}" if card.hyperfoam else ""
    said = [f"{law.body.capitalize()}: {law.name} law{terms}, initial shear modulus μ₀ = {middle} {unit}"
            + (f" (95 %: {ends})" if known else "") + f", {moduli(law)}."]
    kinds = [kind for kind in MODES if any(row["kind"] == kind for row in tests(card).values())]
    errors = [f"{percent(relative_rms(card, kind))} in {kind}" for kind in kinds]
    return said + ([f"It misses the data by {', '.join(errors)} (relative RMS), fitted over {ranges(card)}."]
                   if errors else [])


def _series_findings(card: MaterialCard) -> list[str]:
    if card.prony is None:
        return []
    tau = card.prony.tau_s
    times = f"times of {', '.join(number(t) for t in tau)} s" if tau.size <= _LISTED else (
        f"{tau.size} times from {number(tau[0])} to {number(tau[-1])} s")
    return [f"Relaxation: held at constant strain the stress falls by {percent(1 - card.prony.g_infinity, 3)}, with "
            f"{times}."]


def _skin_findings(card: MaterialCard) -> list[str]:
    if card.conductivity is None:
        return []
    law = card.conductivity
    lo, hi = law.strain_range
    end = float(conductivity(law, hi))
    return [f"Skin: {number(law.c0_S_per_m)} S/m unstrained, {number(end)} S/m at a strain of {number(hi)}; measured "
            f"for strains of {interval(lo, hi)}, everything outside is extrapolated."]
