"""Tables of a calibration: parameters (paper, table 1), cross prediction, orders, stability, validity, files."""

from collections.abc import Mapping, Sequence
from typing import Any

from matcal.card import MaterialCard
from matcal.laws.hyperfoam import Hyperfoam
from matcal.record import result_tables
from matcal.record.cautions import NAMES, relative_rms, tests
from matcal.record.exporters.deck import export
from matcal.record.exporters.programs import targets
from matcal.record.result_tables import Printed
from reports.document.numerals import counted, interval, number, pascals, percent, plus_minus, typeset
from reports.document.page import Table


def parameters(card: MaterialCard) -> Table:
    """The paper's table 1: one row a term, standard errors behind ± where the card has them."""
    law, prony = card.hyperfoam, card.prony
    if law is None and card.law is not None:
        rows = [[name, _pm(row["value"], row["stderr"])] for name, row in card.fit.get("parameters", {}).items()]
        return Table(f"Parameters of the law {card.law.name}, with one standard error each.", ["", "value"], rows, "lr")
    errors, series = card.fit.get("parameters", {}), card.fit.get("prony", {})
    count = max(law.mu_Pa.size if law else 0, prony.g.size if prony else 0)
    rows = [[str(i + 1)] for i in range(count)]
    factor, unit = pascals(law.mu_Pa) if law else (1.0, "Pa")
    for i, row in enumerate(rows):
        if law is not None:
            row += [_pm(factor * law.mu_Pa[i], _stderr(errors, f"mu_{i + 1}_Pa"), factor),
                    _pm(law.alpha[i], _stderr(errors, f"alpha_{i + 1}")),
                    number(law.beta[i])] if i < law.mu_Pa.size else ["", "", ""]
        if prony is not None:
            row += [_pm(prony.g[i], _at(series, "g_sd", i)),
                    _pm(prony.tau_s[i], _at(series, "tau_sd_s", i))] if i < prony.g.size else ["", ""]
    head = ["i"] + ([f"μᵢ ({unit})", "αᵢ (–)", "βᵢ (–)"] if law else []) + (["gᵢ (–)", "τᵢ (s)"] if prony else [])
    return Table(_parameter_caption(law, errors), head, rows, "l" + "r" * (len(head) - 1))


def _parameter_caption(law: Hyperfoam | None, errors: Mapping[str, Any]) -> str:
    caption = "Parameters"
    if law is not None and (shares := [e / abs(m) for i, m in enumerate(law.mu_Pa)
                                       if (e := _stderr(errors, f"mu_{i + 1}_Pa")) is not None]):
        caption += (f", with one standard error each: a single μᵢ is known to {percent(min(shares))} at best and to "
                    f"{percent(max(shares))} at worst")
        caption += ". These errors take residuals as independent and the law as exact; quote the results above"
    elif law is not None and errors:
        caption += "; single terms have no standard errors, because the tests do not distinguish them"
    return caption + "."


def _stderr(errors: Mapping[str, Any], key: str) -> float | None:
    return errors.get(key, {}).get("stderr")


def _at(series: Mapping[str, Sequence[float]], key: str, i: int) -> float | None:
    return float(series[key][i]) if key in series else None


def _pm(value: float, error: float | None, factor: float = 1.0) -> str:
    return number(value, 4) if error is None else plus_minus(value, factor * error)


def softening(card: MaterialCard) -> Table:
    """Numbers of the softening, the set and the loop, with their intervals."""
    table = result_tables.softening(card)
    looped = card.softening is not None and card.softening.loop_share > 0
    what = ", set and the loop of a cycle that repeats itself" if looped else " and set"
    return printed(table, f"Softening by earlier loading (Ogden and Roxburgh){what}, with one standard error each. "
                          f"{' '.join(table.notes)}")


def laws(card: MaterialCard) -> Table:
    """The laws that were compared."""
    table = result_tables.laws(card)
    return printed(table, f"Laws that were compared, * in the card. {' '.join(table.notes)}")


def skin(card: MaterialCard) -> Table:
    """The conductivity law's parameters, standard errors behind ± where the card has them."""
    law, found = card.conductivity, card.fit.get("conductivity", {})
    assert law is not None
    row = [_pm(law.c0_S_per_m, found.get("c0_sd_S_per_m")),
           *(_pm(a, _at(found, "a_sd", k)) for k, a in enumerate(law.a))]
    caption = f"Conductivity, {law.kind} law, fitted for strains of {interval(*law.strain_range)}"
    caption += ", with one standard error each." if "a_sd" in found else "."
    if found.get("chi_square") is not None:
        caption += f" Chi-square is {number(found['chi_square'], 4)} on {found['freedom']} degrees of freedom."
    heads = [f"a{chr(ord('₁') + k)} (–)" for k in range(law.a.size)]
    return Table(caption, ["c₀ (S/m)", *heads], [row], "r" * len(row))


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


def orders(card: MaterialCard) -> Table:
    """Orders tried, with their information criterion."""
    assert card.hyperfoam is not None
    tried, chosen = card.fit["orders"], card.hyperfoam.mu_Pa.size
    least = min(row["bic"] for row in tried)
    rows = [[f"{r['order']}{', chosen' if r['order'] == chosen else ''}", percent(r["rms"], 3),
             number(r["bic"] - least, 3), r["confluence"] or "–"] for r in tried]
    row = next(r for r in tried if r["order"] == chosen)
    caption = (f"Orders tried; the law has {counted(chosen, 'term')}, with a weighted residual of "
               f"{percent(row['rms'], 3)}. BIC = n ln(residual²) + 2 N ln n, above the least of all.")
    return Table(caption, ["terms", "weighted residual", "BIC above least", "what makes single parameters meaningless"],
                 rows, "lrrw")


def stability(card: MaterialCard) -> Table:
    """Unstable strains by mode and criterion."""
    found = card.stability
    modes = list(next(iter(found.values())))
    rows = [[mode, *(_spans(found[criterion][mode]["unstable_strain"]) for criterion in found)] for mode in modes]
    lost = sum(not found[criterion][mode]["stable"] for criterion in found for mode in modes)
    caption = (f"Unstable strains: {lost} of {len(modes) * len(found)} combinations of mode and criterion lose "
               "stability.")
    head = ["mode", *(f"{NAMES.get(criterion, criterion)} lost at" for criterion in found)]
    return Table(caption, head, rows, "l" + "w" * len(found))


def _spans(strains: Sequence[tuple[float, float]]) -> str:
    return "; ".join(interval(a, b) for a, b in strains) or "nowhere"


def exports(card: MaterialCard) -> Table:
    """What each finite-element program can be given of this card."""
    found = {target: _exported(card, target) for target in targets()}
    written = [warnings for warnings in found.values() if not isinstance(warnings, str)]
    common = [w for w in written[0] if all(w in warnings for warnings in written)] if written else []
    rows = []
    for target, result in found.items():
        words = result if isinstance(result, str) else " ".join(w for w in result if w not in common)
        rows.append([target, "refused" if isinstance(result, str) else "written",
                     typeset(words).replace("`", "") or "–"])
    caption = (f"Export: {counted(len(written), 'program')} of {len(targets())} "
               f"{'takes' if len(written) == 1 else 'take'} this law; matcal export writes the input, with units, "
               "moduli and warnings as comments. " + typeset(" ".join(common)))
    return Table(caption.rstrip(), ["program", "", "what it does otherwise, or why it is refused"], rows, "llw")


def _exported(card: MaterialCard, target: str) -> tuple[str, ...] | str:
    """The warnings of an export, or why it is refused."""
    try:
        return export(card, target).warnings
    except ValueError as refusal:
        return str(refusal)


def printed(table: Printed, caption: str) -> Table:
    """A table of the terminal on a page."""
    rows = [[typeset(cell) for cell in row] for row in table.rows]
    return Table(caption, table.head, rows, table.align.replace("<", "l").replace(">", "r"))


def replicates(card: MaterialCard) -> Table:
    """How specimens of one kind differ."""
    rows = [row for row in tests(card).values() if "stiffness_factor" in row]
    worst = max(rows, key=lambda row: row["stiffness_factor_sd"])
    return printed(result_tables.replicates(card), (
        f"Specimens: in {worst['kind']} their values scatter by {percent(worst['stiffness_factor_sd'])} (standard "
        f"deviation of the factors), and {percent(worst['shape_scatter'])} more in shape."))


def next_specimen(card: MaterialCard) -> Table:
    """Intervals of the mean of all specimens, and of the next one."""
    held = [row["held_by_others"] for row in tests(card).values() if "held_by_others" in row]
    caption = "The next specimen, Pa: ln stress is taken as normal over specimens."
    if held:
        caption += f" The intervals of the others hold {percent(sum(held) / len(held))} of a specimen that is left out."
    return printed(result_tables.next_specimen(card), caption)


def predicted(card: MaterialCard) -> Table:
    """Errors on the tests that were kept out of the fit."""
    worst = max(card.fit["predicted"], key=lambda row: row["relative_rms"]["combined"])
    return printed(result_tables.predicted(card), (
        "Predicted, not fitted: relative RMS of each law. The law of all modes misses "
        f"{', '.join(worst['source'])} ({worst['kind']}) by {percent(worst['relative_rms']['combined'], 3)}."))


def stability_cost(card: MaterialCard) -> Table:
    """Errors of the law that was held stable, and of the free one."""
    found = card.fit["without_stability"]["relative_rms_of"]
    added = {label: card.fit[label]["relative_rms"] - share for label, share in found.items()}
    most = max(added, key=lambda label: added[label])
    return printed(result_tables.stability_cost(card), (
        f"What stability costs: at most {percent(card.fit[most]['relative_rms'], 3)} instead of "
        f"{percent(found[most], 3)}, in {most} (relative RMS)."))


def by_test(card: MaterialCard) -> Table:
    """Errors of every law in every test."""
    return printed(result_tables.by_test(card), "Relative RMS of each law in each test.")


def series_orders(card: MaterialCard) -> Table:
    """Numbers of Prony terms tried."""
    assert card.prony is not None
    caption = (f"Terms of the Prony series tried; it has {counted(card.prony.g.size, 'term')}. Residuals are "
               "weighted by the precision of each point, which those of the tests are not.")
    if slowest := card.fit["prony"].get("slowest_s"):
        end = "without an upper end" if slowest["hi"] is None else f"to {number(slowest['hi'])} s"
        caption += (f" The slowest time, {number(slowest['value'])} s, has the 95 % profile interval "
                    f"{number(slowest['lo'])} s {end}.")
    return printed(result_tables.series_orders(card), caption)


def data_stability(card: MaterialCard) -> Table:
    """Where the records themselves violate a criterion."""
    rows = [[row["test"], NAMES.get(row["criterion"], row["criterion"]), interval(*row["covered_strain"]),
             _spans(row["violated_strain"])] for row in card.fit["data_stability"]]
    found = sum(bool(row["violated_strain"]) for row in card.fit["data_stability"])
    caption = (f"The records themselves: {found} of {len(rows)} checks find stress that falls where the criterion "
               "forbids it, whatever the law.")
    return Table(caption, ["test", "criterion", "strain covered", "violated at"], rows, "llrw")


def files(card: MaterialCard) -> Table:
    """The measurement files and their hashes."""
    rows = [[f["name"], f["sha256"]] for f in card.provenance["files"]]
    caption = f"The {counted(len(rows), 'file')} that went into the card."
    return Table(caption, ["file", "sha256 of its bytes"], rows, "wl")
