"""Tables of a calibration as the terminal shows them, read from its card, values with the digits they deserve."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matcal.card import MaterialCard
from matcal.laws.deformation_modes import MODES
from matcal.laws.histories.time_temperature import Wlf
from matcal.record.cautions import own_rms, relative_rms, tests
from touchcal.number_words import counted, percent, significant, with_error, within

MEANING = {"mu_0_Pa": "initial shear modulus", "E_0_Pa": "initial Young's modulus",
           "plateau_Pa": "stress at 40 % strain", "g_infinity": "long-term share",
           "mu_0_instantaneous_Pa": "before relaxation", "mu_0_new_specimen_Pa": "of a further specimen",
           "omega": "scatter of ln stiffness", "c0_S_per_m": "unstrained skin",
           **{f"a_{k}": "of the skin's law" for k in (1, 2, 3)}}


# what follows the meaning of a quantity that the tests leave open
OPEN = ", not determined by these tests"


@dataclass(frozen=True)
class Printed:
    """One table, cells already formatted."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    # one letter a column: < left, > right, w left and folded where the line is too short
    align: str
    # sentences below it
    notes: Sequence[str] = ()
    # heads of columns that are left out, the first one first, where the line is too short
    spare: Sequence[str] = ()


def derived(card: MaterialCard) -> Printed:
    """What the tests measure, by linearisation and, where it was sampled, by the posterior."""
    linear: Mapping[str, Any] = card.fit.get("derived", {})
    drawn: Mapping[str, Any] = card.posterior.get("derived", {})
    left, rows = card.fit.get("not_determined", ()), _nu_rows(card, drawn)
    for name in dict.fromkeys([*linear, *drawn]):
        if name == "nu":
            continue
        own = linear.get(name) or {**drawn[name], "value": drawn[name]["median"]}
        value, interval = within(own["value"], own["lo"], own["hi"])
        sampled = [_posterior(drawn.get(name))] if drawn else []
        rows.append([name, value, interval if name in linear else "-", *sampled,
                     MEANING.get(name, "") + (OPEN if name in left else "")])
    if (further := card.fit.get("next_specimen", {}).get("mu_0_Pa")) and "mu_0_new_specimen_Pa" not in drawn:
        value, interval = within(further["value"], further["next_lo"], further["next_hi"])
        rows.append(["mu_0_new_specimen_Pa", value, interval, *(["-"] if drawn else []),
                     MEANING["mu_0_new_specimen_Pa"]])
    head = ["quantity", "value", "95 % interval", *(["95 % posterior"] if drawn else []), "what it is"]
    title = f"Results: {card.law.moduli} moduli" if card.law else "Results"
    return Printed(title.replace("longterm", "long-term"), head, rows, "<>>" + (">" if drawn else "") + "w",
                   [card.fit["intervals"]] if "intervals" in card.fit else (), () if left else ("what it is",))


def _nu_rows(card: MaterialCard, drawn: Mapping[str, Any]) -> list[list[str]]:
    """A fitted nu with its interval, one row or one a term."""
    found, left = card.fit.get("nu", {}), card.fit.get("not_determined", ())
    if "interval" not in found:
        return []
    one = not isinstance(found["value"], Sequence)
    each = {"nu": (found["value"], found["interval"])} if one else {
        f"nu_{k}": pair for k, pair in enumerate(zip(found["value"], found["interval"], strict=True), 1)}
    return [[name, *within(value, *ends), *([_posterior(drawn.get(name))] if drawn else []),
             "Poisson-like ratio" + (OPEN if name in left else "")] for name, (value, ends) in each.items()]


def _posterior(row: Mapping[str, float] | None) -> str:
    return within(row["median"], row["lo"], row["hi"])[1] if row else "-"


def law(card: MaterialCard) -> Printed:
    """Terms of the hyperfoam law, or the parameters of another."""
    errors, rows = card.fit["parameters"], []
    if card.hyperfoam is None:
        rows = [[name, *_pair(row["value"], row["stderr"])] for name, row in errors.items()]
        return Printed(f"Law {card.law.name if card.law else ''}, one standard error each", ["", "value", "+-"], rows,
                       "<>>", ())
    for k, (mu, alpha, nu) in enumerate(zip(card.hyperfoam.mu_Pa, card.hyperfoam.alpha, card.hyperfoam.nu,
                                            strict=True), 1):
        rows.append([str(k), *_pair(mu, _stderr(errors, f"mu_{k}_Pa")), *_pair(alpha, _stderr(errors, f"alpha_{k}")),
                     significant(float(nu), 3)])
    head = ["i", "mu_Pa", "+-", "alpha", "+-", "nu"]
    return Printed("Hyperfoam terms, one standard error each", head, rows, ">>>>>>",
                   ("Single terms compensate each other; read the results above.",))


def laws(card: MaterialCard, most: int | None = None) -> Printed:
    """The laws that were compared: how they fit, predict what they were not fitted to, and count in the band; `most`:
    the first of them alone, and the card's with its parameters in a line."""
    chosen = card.law.name if card.law is not None else ""
    compared, rows, notes = card.fit["laws"], [], []
    shown = [row for k, row in enumerate(compared) if most is None or k < most or row["law"] == chosen]
    for row in shown:
        doubts = [f"unstable in {', '.join(row['unstable'])}"] if row["unstable"] else []
        doubts += [f"leaves {', '.join(row['left_open'])} open"] if row["left_open"] else []
        terms = next((len(values) for values in row["parameters"].values() if not isinstance(values, int | float)), 0)
        rows.append([row["law"] + (f", {terms} terms" if terms else "")
                     + (" *" if row["law"] == chosen else "  "), percent(row["fitted"]),
                     percent(row["predicted"]), percent(row["weight"], 2), "; ".join(doubts) or "-"])
    if most is not None:
        values = (f"{name} {' +- '.join(_pair(row['value'], row['stderr'])[:2 if row['stderr'] else 1])}"
                  for name, row in card.fit["parameters"].items())
        left = counted(len(compared) - len(shown), "law") + " of less weight left out"
        notes.append(f"{chosen}, +- one standard error where known: {', '.join(values)}; {left}.")
    several = card.law is not None and len(card.law.strain_range) > 1
    notes.append("Predicted: each mode from the others, which may leave open what all of them determine; laws within "
                 "one standard error of the best weigh the same." if several else
                 "Predicted: each third of the strains from the others.")
    notes.append("The one that fits best is taken, of those with at least half the largest weight.")
    if test := card.fit.get("deciding_test"):
        notes.append(f"A {test['mode']} test would separate them most: there they differ by "
                     f"{percent(test['laws_differ_by'], 2)} (standard deviation).")
    return Printed("Laws (* in the card)", ["law", "fits", "predicts", "weight", "what is wrong with it"], rows,
                   "<>>>w", notes)


def series(card: MaterialCard) -> Printed:
    """Terms of the Prony series."""
    assert card.prony is not None
    sd = card.fit.get("prony", {})
    rows, fitted = [], any(sd.get("tau_sd_s", ()))
    for k, (g, tau) in enumerate(zip(card.prony.g, card.prony.tau_s, strict=True)):
        rows.append([str(k + 1), *_pair(g, _at(sd, "g_sd", k)), *(
            _pair(tau, _at(sd, "tau_sd_s", k)) if fitted else [significant(float(tau))])])
    head = ["i", "g", "+-", "tau_s", *(["+-"] if fitted else [])]
    return Printed("Prony series, one standard error each", head, rows, ">" * len(head),
                   (f"Long-term over instantaneous modulus: {significant(card.prony.g_infinity)}.",
                    *(f"{name} = {' ± '.join(_pair(row['value'], row['sd']))}."
                      for name, row in sd.get("instantaneous", {}).items()),
                    *(_slowest(sd) if fitted else []), *_shift(card)))


def _shift(card: MaterialCard) -> list[str]:
    """The law of the shift with temperature and its standard errors."""
    if card.shift is None:
        return []
    names = [("C1", card.shift.C1, ""), ("C2", card.shift.C2_K, " K")] if isinstance(card.shift, Wlf) else [
        ("E_a", card.shift.activation_J_per_mol / 1e3, " kJ/mol")]
    sd = card.fit.get("prony", {}).get("shift", {}).get("law_sd", ())
    scale = 1.0 if isinstance(card.shift, Wlf) else 1e-3
    said = ", ".join(f"{name} = {' ± '.join(_pair(value, scale * sd[k] if k < len(sd) else None))}{unit}"
                     for k, (name, value, unit) in enumerate(names))
    kind = "WLF" if isinstance(card.shift, Wlf) else "Arrhenius"
    return [f"Times are those at {significant(card.shift.reference_K - 273.15)} C; {kind} shift: {said}."]


def softening(card: MaterialCard) -> Printed:
    """Numbers of the softening, the set and the loop."""
    assert card.softening is not None
    found = card.fit.get("softening", {})
    rows = []
    looped = card.softening.loop_share > 0
    for name in ("r", "m_Pa", "beta", "set_share", *(("loop_share", "loop_turn") if looped else ())):
        value, ends = float(getattr(card.softening, name)), found.get("interval", {}).get(name)
        rows.append([name, *_pair(value, found.get("sd", {}).get(name)),
                     within(value, *ends)[1] if ends is not None else "not determined"])
    missed = ", ".join(percent(rms) for rms in found.get("relative_rms", ()))
    lost = ", ".join(f"{percent(measured, 2)}, by the law {percent(max(law, 0.0), 2)}" for measured, law in
                     found.get("lost", ()))
    notes = ((f"Relative RMS along the whole path: {missed}.",) if missed else ()) + (
        (f"The last cycle loses, of the work put in: {lost}.",) if looped and lost else ())
    return Printed(f"Softening (Ogden-Roxburgh){', set and loop' if looped else ' and set'}, one standard error each",
                   ["", "value", "+-", "95 % interval"], rows, "<>>>", notes)


def _slowest(found: Mapping[str, Any]) -> list[str]:
    if "slowest_s" not in found or not any(found.get("g_sd", ())):
        return []
    row = found["slowest_s"]
    if row["hi"] is None:
        return [f"The slowest time, {row['value']:.3g} s, has no upper end: its 95 % profile interval begins at "
                f"{row['lo']:.3g} s."]
    return [f"The slowest time has the 95 % profile interval {row['lo']:.3g} s to {row['hi']:.3g} s."]


def skin(card: MaterialCard) -> Printed:
    """Coefficients of the conductivity law."""
    assert card.conductivity is not None
    found = card.fit.get("conductivity", {})
    pairs = [("c0_S_per_m", card.conductivity.c0_S_per_m, found.get("c0_sd_S_per_m"), found.get("c0_interval_S_per_m"))]
    pairs += [(f"a_{k + 1}", a, _at(found, "a_sd", k), found["a_interval"][k] if "a_interval" in found else None)
              for k, a in enumerate(card.conductivity.a)]
    rows = [[name, *_pair(value, sd), within(value, *ends)[1] if ends is not None else "unknown"]
            for name, value, sd, ends in pairs]
    return Printed(f"Conductivity, {card.conductivity.kind} law, one standard error each",
                   ["", "value", "+-", "95 % interval"], rows, "<>>>",
                   (f"Fitted for strains of {_span(card.conductivity.strain_range)}.",))


def errors(card: MaterialCard) -> Printed:
    """Errors of the fit, one row a test; weights where they differ from equal shares of the kinds."""
    rows, found = [], tests(card)
    weighted, factors = _weighted(found.values()), any("specimen_factor" in row for row in found.values())
    for label, row in found.items():
        rows.append([label, str(row["n"]), "-" if row["kind"] == "dma" else _span(row["strain_range"]),
                     f"{significant(row['rms'], 3)} {row['unit']}", percent(row["relative_rms"]),
                     "-" if row["r2"] is None else _r_squared(row["r2"]),
                     percent(row["inside_band"], 2) if "inside_band" in row else "-",
                     *([significant(row["weight"], 2)] if weighted else []),
                     *([significant(row.get("specimen_factor", 1.0)), percent(own_rms(row))] if factors else [])])
    head = ["test", "points", "strain", "rms", "relative", "R2", "in band", *(["weight"] if weighted else []),
            *(["factor", "after it"] if factors else [])]
    return Printed("Errors of the fit", head, rows, "<" + ">" * (len(head) - 1), (), ("points", "R2", "in band"))


def _weighted(rows: Iterable[Mapping[str, Any]]) -> bool:
    """Whether one kind of stress-strain curve counts more than another."""
    shares: dict[str, float] = {}
    for row in rows:
        if row["kind"] in MODES:
            shares[row["kind"]] = shares.get(row["kind"], 0.0) + row["weight"]
    return bool(shares) and max(shares.values()) > 1.01 * min(shares.values())


def cross(card: MaterialCard) -> Printed:
    """Relative RMS of the laws of single modes, and of the card's, in every mode."""
    alone = card.fit["cross_prediction"]
    modes = list(next(iter(alone.values()))["relative_rms"])
    rows = [["all modes", *(percent(relative_rms(card, mode)) for mode in modes)]]
    rows += [[f"{name} alone", *(percent(found["relative_rms"][mode]) for mode in modes)]
             for name, found in alone.items()]
    return Printed("Relative RMS, by what was fitted", ["fitted to", *(f"in {m}" for m in modes)], rows,
                   "<" + ">" * len(modes))


def replicates(card: MaterialCard) -> Printed:
    """How each specimen differs from the mean of its kind, and whether the others would have expected it."""
    rows = [[label, row["kind"], significant(row["stiffness_factor"]), percent(row["stiffness_factor_sd"], 2),
             percent(row["shape_scatter"], 2), percent(row["held_by_others"], 2) if "held_by_others" in row else "-"]
            for label, row in tests(card).items() if "stiffness_factor" in row]
    return Printed("Specimens", ["test", "kind", "value over mean", "scatter", "shape scatter", "held by the others"],
                   rows, "<<>>>>", (
                       "Scatter is the standard deviation of the factors of a kind; shape scatter what they leave.",
                       "Held by the others: the share of a specimen within the interval of the next one after them."))


def next_specimen(card: MaterialCard) -> Printed:
    """Intervals of the mean of all specimens, and of the next one."""
    rows = [[name, *within(row["value"], row["lo"], row["hi"]), within(row["value"], row["next_lo"], row["next_hi"])[1]]
            for name, row in card.fit["next_specimen"].items()]
    return Printed("Next specimen (Pa)", ["quantity", "mean", "95 % of the mean", "95 % of the next"], rows, "<>>>",
                   ("ln stress is taken as normal over specimens.",))


def predicted(card: MaterialCard) -> Printed:
    """Relative RMS of every law on the tests that were kept out of the fit."""
    tested = card.fit["predicted"]
    laws = list(tested[0]["relative_rms"])
    rows = [[", ".join(row["source"]), row["kind"], _span(row["strain_range"]),
             *(percent(row["relative_rms"][law]) for law in laws)] for row in tested]
    return Printed("Predicted, not fitted: relative RMS", ["file", "mode", "strain", *laws], rows,
                   "w<>" + ">" * len(laws))


def stability_cost(card: MaterialCard) -> Printed:
    """Relative RMS of the law held stable, next to that of the free one."""
    free, held = card.fit["without_stability"]["relative_rms_of"], tests(card)
    rows = [[label, percent(own_rms(held[label])), percent(share)] for label, share in free.items()]
    return Printed("What stability costs: relative RMS", ["test", "held stable", "free"], rows, "<>>")


def by_test(card: MaterialCard) -> Printed:
    """Relative RMS of every law in every test, where some mode was tested more than once."""
    alone, found = card.fit["cross_prediction"], tests(card)
    rows = [[label, percent(own_rms(found[label])),
             *(percent(law["relative_rms_of"][label]) for law in alone.values())]
            for label in next(iter(alone.values()))["relative_rms_of"]]
    return Printed("Relative RMS by test", ["test", "all modes", *(f"{mode} alone" for mode in alone)], rows,
                   "<" + ">" * (1 + len(alone)))


def series_orders(card: MaterialCard) -> Printed:
    """Numbers of Prony terms tried, with their information criterion."""
    assert card.prony is not None
    tried = card.fit["prony"]["orders"]
    best = min(row["bic"] for row in tried)
    rows = [[str(row["order"]) + (" *" if row["order"] == card.prony.g.size else "  "), percent(row["rms"]),
             f"{row['bic'] - best:.0f}"] for row in tried]
    return Printed("Terms of the Prony series (* chosen)", ["terms", "residual", "BIC above least"], rows, ">>>")


def stability(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Printed:
    """Where each criterion is lost in each mode."""
    rows = []
    for mode, first in next(iter(found.values())).items():
        lost = [", ".join(f"{lo:.3g} to {hi:.3g}" for lo, hi in modes[mode]["unstable_strain"]) or "nowhere"
                for modes in found.values()]
        rows.append([mode, "{:.3g} to {:.3g}".format(*first["scanned"]), *lost])
    notes = ["Strain is gamma in shear, J in volumetric."]
    if len(found) > 1:
        notes.append("Neither criterion implies the other.")
    return Printed("Stability of the law", ["mode", "scanned", *(f"{criterion} lost at" for criterion in found)], rows,
                   "<<" + "w" * len(found), tuple(notes))


def orders(card: MaterialCard) -> Printed:
    """Numbers of terms tried, with their information criterion."""
    assert card.hyperfoam is not None
    best = min(row["bic"] for row in card.fit["orders"])
    rows = [[str(row["order"]) + (" *" if row["order"] == card.hyperfoam.mu_Pa.size else "  "), percent(row["rms"]),
             f"{row['bic'] - best:.0f}", row["confluence"] or "-"] for row in card.fit["orders"]]
    return Printed("Order of the law (* chosen)", ["terms", "residual", "BIC above least", "what is wrong with it"],
                   rows, ">>>w")


def _pair(value: float, error: float | None) -> tuple[str, str]:
    return with_error(float(value), float(error)) if error else (significant(float(value)), "unknown")


def _stderr(errors: Mapping[str, Any], name: str) -> float | None:
    return errors.get(name, {}).get("stderr")


def _at(found: Mapping[str, Any], key: str, k: int) -> float | None:
    return float(found[key][k]) if key in found else None


def _span(ends: Sequence[float]) -> str:
    lo, hi = ends
    return f"{significant(_near(lo, hi), 3)} to {significant(_near(hi, lo), 3)}"


def _near(end: float, other: float) -> float:
    """An end of a range, 0 where it is as good as that next to the other one."""
    return 0.0 if abs(end) < 1e-4 * abs(other) else end


def _r_squared(value: float) -> str:
    """R2 to the second digit of what it lacks of one."""
    lack = 1 - value
    return f"{value:.4f}" if lack >= 1e-3 or lack <= 0 else f"{value:.{min(7, 1 + len(f'{1 / lack:.0f}'))}f}"
