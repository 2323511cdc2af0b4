"""Two cards next to each other: what both determine, and how far they differ in standard deviations."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from matcal.card import MaterialCard
from matcal.record.result_tables import MEANING, Printed
from touchcal.number_words import percent, significant, with_error

APART = 2.0  # standard deviations from which on two values differ by more than their errors


@dataclass(frozen=True)
class Difference:
    """One quantity of two cards."""

    name: str  # with its unit
    first: float
    second: float
    first_sd: float | None  # standard deviation, same unit; None where the card has none
    second_sd: float | None
    sds: float | None  # second minus first over the standard deviation of that; None where a card has none


def quoted(card: MaterialCard, name: str) -> Mapping[str, float] | None:
    """The one interval that is stated of a derived quantity, with the law's own value: of the posterior where it
    converged and holds it, else of the fit; None where the card has neither."""
    row, drawn = card.fit.get("derived", {}).get(name), card.posterior.get("derived", {}).get(name)
    if drawn is None or not card.posterior.get("checks", {}).get("converged"):
        return row
    return {"value": row["value"] if row else drawn["median"], "lo": drawn["lo"], "hi": drawn["hi"],
            "sd": drawn["sd"]}


def differences(one: MaterialCard, other: MaterialCard) -> list[Difference]:
    """Every quantity that both cards hold; ValueError where there is none, or one foam's moduli are long-term and the
    other's instantaneous."""
    labels = {card.law.moduli for card in (one, other) if card.law}
    if len(labels) > 1:
        raise ValueError(f"the moduli of '{one.name}' and '{other.name}' are {' and '.join(sorted(labels))}, which "
                         "cannot be compared. Fit the instantaneous ones again with a relaxation file.")
    first, second = _quantities(one), _quantities(other)
    found = []
    for name in first:
        if name in second:
            (a, sd), (b, other_sd) = first[name], second[name]
            spread = math.hypot(sd or 0.0, other_sd or 0.0)
            found.append(Difference(name, a, b, sd, other_sd, (b - a) / spread if sd and other_sd else None))
    if not found:
        raise ValueError(f"the cards '{one.name}' and '{other.name}' have no fitted part in common. Compare cards of "
                         "the same kinds of test.")
    return found


def _quantities(card: MaterialCard) -> dict[str, tuple[float, float | None]]:
    """Name -> value and standard deviation of what a card determines."""
    found: dict[str, tuple[float, float | None]] = {}
    if (law := card.law) is not None:
        found |= {"mu_0_Pa": (law.mu_0_Pa, None), "E_0_Pa": (law.E_0_Pa, None)}
    if card.prony is not None:
        found["g_infinity"] = (card.prony.g_infinity, card.fit.get("prony", {}).get("g_infinity_sd"))
    if card.conductivity is not None:
        sd = card.fit.get("conductivity", {}).get("c0_sd_S_per_m")
        found["c0_S_per_m"] = (card.conductivity.c0_S_per_m, sd)
    for name in dict.fromkeys([*card.fit.get("derived", {}), *found]):
        if (row := quoted(card, name)) is not None:
            found[name] = (found[name][0] if name in found else row["value"], row["sd"])
    return found


def names_of(first: Path, second: Path) -> tuple[str, str]:
    """What two cards are called: their file names, with the folder where these are the same."""
    return (first.stem, second.stem) if first.stem != second.stem else (str(first), str(second))


def table(found: list[Difference], names: tuple[str, str]) -> Printed:
    """The differences as the terminal and the report show them."""
    rows = [[one.name, _value(one.first, one.first_sd), _value(one.second, one.second_sd),
             percent(one.second / one.first - 1, 2) if one.first else "-",
             "unknown" if one.sds is None else f"{one.sds:.1f}", MEANING.get(one.name, "")] for one in found]
    return Printed("Two cards", ["quantity", names[0], names[1], "difference", "in sd", "what it is"], rows, "<>>>>w",
                   (f"In sd: over the standard deviation of the difference; from {APART:g} on the cards differ.",))


def _value(value: float, sd: float | None) -> str:
    return " +- ".join(with_error(value, sd)) if sd else significant(value)
