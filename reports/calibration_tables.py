"""Tables of a calibration: derived quantities, parameters (paper, table 1), errors of fit, orders, files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from matcal.card import MaterialCard
from matcal.hyperfoam import Hyperfoam
from matcal.modes import nominal_stress
from reports.numerals import counted, interval, number, percent, plus_minus, r_squared
from reports.page import Table
from reports.stability_plates import NAMES

# key -> name, unit, factor from SI
DERIVED = {"mu_0_Pa": ("initial shear modulus μ₀", "kPa", 1e-3), "E_0_Pa": ("initial Young's modulus E₀", "kPa", 1e-3),
           "plateau_Pa": ("plateau stress, at 40 % compression", "kPa", 1e-3)}
PLATEAU_STRAIN = -0.4


def law_values(law: Hyperfoam) -> dict[str, float]:
    """The derived quantities of a law, by the keys of DERIVED, Pa."""
    return {"mu_0_Pa": law.mu_0_Pa, "E_0_Pa": law.E_0_Pa,
            "plateau_Pa": -float(nominal_stress(law, "uniaxial", PLATEAU_STRAIN))}


def derived(card: MaterialCard) -> Table:
    """What the tests determine: derived quantities with their 95 % intervals, where the card has them."""
    assert card.hyperfoam is not None
    known, drawn = card.fit.get("derived", {}), card.posterior.get("derived", {})
    rows = []
    for key, value in law_values(card.hyperfoam).items():
        name, unit, factor = DERIVED[key]
        sampled = [_ends(drawn, key, factor)] if drawn else []
        rows.append([f"{name}, {_moduli(card)}", unit, number(factor * value, 4), _ends(known, key, factor), *sampled])
    if card.prony is not None:
        rows.append(["long-term over instantaneous modulus", "–", number(card.prony.g_infinity, 4), "–",
                     *(["–"] if drawn else [])])
    widest = max(((v["hi"] - v["lo"]) / 2 / abs(v["value"]) for k, v in known.items() if k in DERIVED), default=None)
    caption = ("Derived quantities: what the tests determine"
               + (f", each to ± {percent(widest)} or better at 95 %." if widest is not None else
                  "; the card holds no intervals."))
    head = ["quantity", "unit", "value", "95 % interval", *(["95 %, posterior"] if drawn else [])]
    return Table(caption, head, rows, "wlrr" + ("r" if drawn else ""))


def _ends(found: Mapping[str, Any], key: str, factor: float) -> str:
    return interval(factor * found[key]["lo"], factor * found[key]["hi"], 4) if key in found else "not in the card"


def _moduli(card: MaterialCard) -> str:
    assert card.hyperfoam is not None
    return {"longterm": "long-term"}.get(card.hyperfoam.moduli, card.hyperfoam.moduli)


def parameters(card: MaterialCard) -> Table:
    """The paper's table 1: one row a term, standard errors behind ± where the card has them."""
    law, prony = card.hyperfoam, card.prony
    errors, series = card.fit.get("parameters", {}), card.fit.get("prony", {})
    count = max(law.mu_Pa.size if law else 0, prony.g.size if prony else 0)
    rows = []
    for i in range(count):
        row = [str(i + 1)]
        if law is not None:
            inside = i < law.mu_Pa.size
            row += [_pm(law.mu_Pa[i] / 1e3, _stderr(errors, f"mu_{i + 1}_Pa"), 1e-3) if inside else "",
                    _pm(law.alpha[i], _stderr(errors, f"alpha_{i + 1}")) if inside else "",
                    number(law.beta[i]) if inside else ""]
        if prony is not None:
            inside = i < prony.g.size
            row += [_pm(prony.g[i], _at(series, "g_sd", i)) if inside else "",
                    _pm(prony.tau_s[i], _at(series, "tau_sd_s", i)) if inside else ""]
        rows.append(row)
    head = ["i"] + (["μᵢ (kPa)", "αᵢ (–)", "βᵢ (–)"] if law else []) + (["gᵢ (–)", "τᵢ (s)"] if prony else [])
    return Table(_parameter_caption(law, errors), head, rows, "l" + "r" * (len(head) - 1))


def _parameter_caption(law: Hyperfoam | None, errors: Mapping[str, Any]) -> str:
    caption = "Parameters"
    if law is not None and (shares := [e / abs(m) for i, m in enumerate(law.mu_Pa)
                                       if (e := _stderr(errors, f"mu_{i + 1}_Pa")) is not None]):
        caption += (f", with one standard error each: a single μᵢ is known to {percent(min(shares))} at best and to "
                    f"{percent(max(shares))} at worst")
        if (sum_error := _stderr(errors, "mu_0_Pa")) is not None:
            caption += f", their sum μ₀ to {percent(sum_error / law.mu_0_Pa)}"
        caption += ". These errors take residuals as independent and the law as exact"
    return caption + "."


def _stderr(errors: Mapping[str, Any], key: str) -> float | None:
    return errors.get(key, {}).get("stderr")


def _at(series: Mapping[str, Sequence[float]], key: str, i: int) -> float | None:
    return float(series[key][i]) if key in series else None


def _pm(value: float, error: float | None, factor: float = 1.0) -> str:
    return number(value, 4) if error is None else plus_minus(value, factor * error)


def skin(card: MaterialCard) -> Table:
    """The conductivity law's parameters, and the standard deviations of its coefficients where the card has them."""
    law, errors = card.conductivity, card.fit.get("conductivity", {})
    assert law is not None
    rows = [["value", number(law.c0_S_per_m, 4), *(number(a, 4) for a in law.a)]]
    if "coefficient_sd_S_per_m" in errors:
        rows.append(["standard deviation of c₀, c₀aᵢ (S/m)",
                     *(number(sd, 2) for sd in errors["coefficient_sd_S_per_m"])])
    caption = f"Conductivity law, fitted for strains of {interval(*law.strain_range)}."
    if errors.get("chi_square") is not None:
        caption += f" Chi-square is {number(errors['chi_square'], 4)} on {errors['freedom']} degrees of freedom."
    return Table(caption, ["", "c₀ (S/m)", "a₁ (–)", "a₂ (–)", "a₃ (–)"], rows, "wrrrr")


def goodness(card: MaterialCard) -> Table:
    """Errors of fit, one row a test."""
    tests = {label: row for label, row in card.fit.items() if isinstance(row, Mapping) and "relative_rms" in row}
    rows = []
    for label, row in tests.items():
        unit = row.get("unit", "")
        rows.append([label, ", ".join(row.get("source", [])), str(row["n"]), number(row["weight"]),
                     f"{number(row['rms'])} {unit}", percent(row["relative_rms"]), r_squared(row["r2"])])
    worst = max(tests, key=lambda label: tests[label]["relative_rms"])
    caption = (f"Errors of fit: the largest relative RMS is {percent(tests[worst]['relative_rms'])}, of {worst}."
               " Relative RMS is rms(residual)/rms(measured), of a relaxation over its hold.")
    head = ["test", "file", "n", "weight", "RMS", "relative RMS", "R²"]
    return Table(caption, head, rows, "lwrrrrr")


def cross(card: MaterialCard) -> Table:
    """Relative RMS of each fit in each mode."""
    alone = card.fit["cross_prediction"]
    modes = list(next(iter(alone.values()))["relative_rms"])
    rows = [["all modes", *(percent(relative_rms(card, mode), 3) for mode in modes)]]
    rows += [[f"{name} alone", *(percent(found["relative_rms"][mode], 3) for mode in modes)]
             for name, found in alone.items()]
    worst, mode, error = max(((name, mode, found["relative_rms"][mode]) for name, found in alone.items()
                              for mode in modes if mode != name), key=lambda t: t[2])
    caption = (f"Cross prediction: what a law misses where it was not fitted. At worst the law of {worst} alone misses "
               f"{mode} by {percent(error, 3)}.")
    return Table(caption, ["fitted to", *(f"relative RMS in {mode}" for mode in modes)], rows, "w" + "r" * len(modes))


def relative_rms(card: MaterialCard, kind: str) -> float:
    """Relative RMS of the card's law over all tests of a kind."""
    found = [row["relative_rms"] for row in card.fit.values() if isinstance(row, Mapping) and row.get("kind") == kind]
    return float(np.sqrt(np.mean(np.square(found))))


def orders(card: MaterialCard) -> Table:
    """Orders tried, with their information criterion."""
    assert card.hyperfoam is not None
    tried = card.fit["orders"]
    chosen = card.hyperfoam.mu_Pa.size
    rows = [[str(r["order"]), percent(r["rms"], 3), number(r["bic"], 5), r["confluence"] or "–"] for r in tried]
    row = next(r for r in tried if r["order"] == chosen)
    caption = (f"Orders tried; the law has {counted(chosen, 'term')}, with a weighted residual of "
               f"{percent(row['rms'], 3)}.")
    return Table(caption, ["order", "weighted residual", "BIC", "what makes single parameters meaningless"], rows,
                 "lrrw")


def stability(found: Mapping[str, Any]) -> Table:
    """Unstable strains by mode and criterion."""
    modes = list(next(iter(found.values())))
    rows = [[mode, *(_unstable(found[criterion][mode]) for criterion in found)] for mode in modes]
    lost = sum(not found[criterion][mode]["stable"] for criterion in found for mode in modes)
    caption = (f"Unstable strains: {lost} of {len(modes) * len(found)} combinations of mode and criterion lose "
               "stability.")
    head = ["mode", *(f"{NAMES.get(criterion, criterion)}: unstable at" for criterion in found)]
    return Table(caption, head, rows, "l" + "w" * len(found))


def _unstable(row: Mapping[str, Any]) -> str:
    return "; ".join(interval(a, b) for a, b in row["unstable_strain"]) or "nowhere"


def files(provenance: Mapping[str, Any]) -> Table:
    """The measurement files and their hashes."""
    rows = [[f["name"], f["sha256"]] for f in provenance["files"]]
    return Table(f"The {counted(len(rows), 'file')} that the card was fitted to.", ["file", "sha256"], rows, "wl")
