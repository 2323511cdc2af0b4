"""What `matcal next` reads and prints."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from matcal.card import MaterialCard
from matcal.record import result_tables as tables
from matcal.record.next_test.next_tests import NextTests, Worth
from touchcal.number_words import percent, significant, within

_SHOWN = 12  # rows on the terminal
_SMALL = 0.01  # narrowing below which no test is of use


def minutes_of(texts: list[str] | None) -> dict[str, float] | None:
    """KIND=MINUTES,... of the command line; ValueError where one cannot be read."""
    if not texts:
        return None
    out = {}
    for cell in ",".join(texts).split(","):
        kind, _, value = cell.partition("=")
        try:
            out[kind.strip()] = float(value)
        except ValueError:
            raise ValueError(f"--minutes '{cell}': write KIND=MINUTES, for example uniaxial=15,biaxial=60.") from None
    return out


def as_json(found: NextTests) -> dict[str, Any]:
    """Plain values: the quantity, and every test with what it narrows to."""
    low, high = found.interval
    return {"quantity": found.quantity, "value": found.value, "sd": found.sd, "lo": low, "hi": high,
            "between_laws": found.between_laws, "scatter_known": found.scatter_known,
            "tests": [{**{name: value for name, value in asdict(each.test).items() if value is not None},
                       "sd": each.sd, "narrows_by": each.narrows_by}
                      | ({} if each.minutes is None else {"minutes": each.minutes}) for each in found.tests]}


def table(found: NextTests, card: MaterialCard) -> tables.Printed:
    """The best test of each kind, and what holds for all of them."""
    shown = found.families[:_SHOWN]
    timed = any(each.minutes is not None for each in shown)
    rows = [[words(each), f"{significant(each.sd, 3)}", percent(each.narrows_by, 2),
             *([f"{each.minutes:g}"] if timed else [])] for each in shown]
    value, interval = within(found.value, *found.interval)
    head = ["test", "sd after", "narrows by", *(["min"] if timed else [])]
    return tables.Printed(f"{found.quantity}: {value} (95 %: {interval}), sd {significant(found.sd, 3)}", head, rows,
                          "<>>" + (">" if timed else ""), list(_notes(found, card)))


def words(each: Worth) -> str:
    """A test in words."""
    test = each.test
    if test.hold_s is not None:
        return f"relaxation, held {significant(test.hold_s, 2)} s"
    parts = [f"{test.kind} to {'J ' if test.kind == 'volumetric' else ''}{test.strain_to:.3g}"]
    if test.ramp_s is not None:
        parts.append(f"in {significant(test.ramp_s, 2)} s")
    if test.lateral:
        parts.append("with lateral strain")
    if test.specimens > 1:
        parts.append(f"{test.specimens} specimens")
    return ", ".join(parts)


def _notes(found: NextTests, card: MaterialCard) -> list[str]:
    out = []
    if not found.tests or found.tests[0].narrows_by < _SMALL:
        out.append("None of these tests narrows it.")
    if found.between_laws:
        out.append(f"{percent(found.between_laws, 2)} of the variance lies between the laws that were compared.")
    else:
        name = card.law.name.replace("_", " ") if card.law else ""
        out.append(f"Expected if the {name} law holds; what another kind of law would say is not in it.")
    if not found.scatter_known:
        out.append("Scatter between specimens is not known. A further specimen of a tested mode would show it.")
    if card.fit.get("nu", {}).get("how") == "assumed":
        out.append("nu is assumed. A lateral strain, or a volumetric test, with --poisson fit would measure it.")
    return out
