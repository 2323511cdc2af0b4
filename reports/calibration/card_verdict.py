"""What a card is good for: stresses, finite elements, the conductivity of a touched skin, a real material."""

from collections.abc import Iterator

from matcal.card import MaterialCard
from matcal.record.cautions import NAMES, own_rms, tests, unstable_inside
from matcal.record.compare import quoted
from reports.calibration.first_page import ranges
from reports.document.numerals import interval, percent
from reports.document.verdict import GOOD, HALF_WIDTH, MISFIT, NOT_USABLE, USABLE, Verdict, graded, real, worst

TOUCHED = -0.5  # a strain that touches reach, compression negative


def verdict(card: MaterialCard) -> list[Verdict]:
    """The lines of a card, one a use."""
    return [*_stress(card), *_stability(card), *_skin(card),
            *real("A real material", bool(card.provenance.get("synthetic")))]


def _stress(card: MaterialCard) -> Iterator[Verdict]:
    rows = [row for row in tests(card).values() if row["kind"] != "conductivity"]
    if not rows:
        return
    misfit = max(own_rms(row) for row in rows)
    grades, why = [graded(misfit, MISFIT)], [f"misses its tests by at most {percent(misfit)}"]
    known = [quoted(card, name) for name in card.fit.get("derived", {})]
    if widths := [(row["hi"] - row["lo"]) / 2 / abs(row["value"]) for row in known if row and row["value"]]:
        grades.append(graded(max(widths), HALF_WIDTH))
        why.append(f"moduli to ± {percent(max(widths))} at 95 %")
    if not card.posterior.get("checks", {}).get("converged", True):
        grades.append(USABLE)
        why.append("the posterior did not converge")
    kinds = [row["kind"] for row in rows]
    if len(kinds) == len(set(kinds)):
        grades.append(USABLE)
        why.append("one specimen of each kind: their scatter is not known")
    where = f"Stress, {ranges(card)}" if card.hyperfoam and ranges(card) else "Relaxation"
    yield Verdict(where, worst(*grades), "; ".join(why))


def _stability(card: MaterialCard) -> Iterator[Verdict]:
    if not card.stability or card.hyperfoam is None:
        return
    lost = unstable_inside(card)
    grade = NOT_USABLE if any(criterion == "elliptic" for criterion, *_ in lost) else USABLE if lost else GOOD
    where = "; ".join(f"{NAMES.get(criterion, criterion)} is lost in {mode} {interval(lo, hi)}"
                      for criterion, mode, lo, hi in lost)
    yield Verdict("Finite elements over these strains", grade, where or "stable at all of them, by every criterion")


def _skin(card: MaterialCard) -> Iterator[Verdict]:
    if (law := card.conductivity) is None:
        return
    inside = law.strain_range[0] <= TOUCHED
    yield Verdict("Conductivity under a touch", GOOD if inside else NOT_USABLE,
                  f"measured for strains of {interval(*law.strain_range)}"
                  + ("" if inside else ", a touch compresses: extrapolated"))
