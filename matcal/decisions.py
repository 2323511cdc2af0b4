"""The decisions of a card under the test or stage that took them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matcal.card import MaterialCard

# what a stage of `matcal.calibrate.Calibration` is called
STAGES = {"records": "all records", "relaxation": "relaxation", "law": "hyperfoam law", "checks": "checks of the law",
          "skin": "conductivity"}


def grouped(card: MaterialCard) -> list[tuple[str, list[str]]]:
    """(test with its files, or stage; its decisions) in order; one group where the card does not part them."""
    sentences: Sequence[str] = card.provenance.get("decisions", ())
    counts: Mapping[str, int] = card.provenance.get("decisions_of", {})
    if sum(counts.values()) != len(sentences):
        return [("in order", [*sentences])] if sentences else []
    out, first = [], 0
    for name, count in counts.items():
        out.append((_title(card, name), [s.removeprefix(f"{name}: ") for s in sentences[first:first + count]]))
        first += count
    return out


def _title(card: MaterialCard, name: str) -> str:
    row = card.fit.get(name)
    if isinstance(row, Mapping) and row.get("source"):
        return f"{name} ({', '.join(row['source'])})"
    return STAGES.get(name, name)
