"""What a card is good for: stresses, finite elements, the conductivity of a touched skin, a real material."""

from collections.abc import Iterator

from matcal.card import MaterialCard
from matcal.record.cautions import NAMES, own_rms, tests, unstable_inside
from matcal.record.compare import quoted
from reports.calibration.first_page import ranges
from reports.document.numerals import interval, number, percent
from reports.document.verdict import GOOD, HALF_WIDTH, MISFIT, NOT_USABLE, USABLE, Verdict, graded, real, worst

# Largest strains in the skin's plane under a wide and light, and under a narrow and heavy touch (Table 1: 18 mm, 0.5 N;
# 10 mm, 2 N), and one through its thickness that touches reach, compression negative.
IN_PLANE, THROUGH = (0.13, 0.43), -0.5


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
    where = f"Stress, {ranges(card)}" if card.law and ranges(card) else "Relaxation"
    yield Verdict(where, worst(*grades), "; ".join(why))


def _stability(card: MaterialCard) -> Iterator[Verdict]:
    if not card.stability or card.law is None:
        return
    lost = unstable_inside(card)
    grade = NOT_USABLE if any(criterion == "elliptic" for criterion, *_ in lost) else USABLE if lost else GOOD
    where = "; ".join(f"{NAMES.get(criterion, criterion)} is lost in {mode} {interval(lo, hi)}"
                      for criterion, mode, lo, hi in lost)
    yield Verdict("Finite elements over these strains", grade, where or "stable at all of them, by every criterion")


def _skin(card: MaterialCard) -> Iterator[Verdict]:
    if (law := card.conductivity) is None:
        return
    grade = (NOT_USABLE, USABLE, GOOD)[sum(law.strain_range[1] >= end for end in IN_PLANE)]
    yield Verdict("Conductivity under a touch", grade,
                  f"measured for strains of {interval(*law.strain_range)}; touches stretch the skin in its plane by up "
                  f"to {number(IN_PLANE[0])} to {number(IN_PLANE[1])}"
                  + ("" if law.strain_range[0] <= THROUGH else ', and with strain = "normal" they extrapolate it'))
