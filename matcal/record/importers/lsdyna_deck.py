"""LS-DYNA: *MAT_HILL_FOAM, *MAT_HYPERELASTIC_RUBBER, *MAT_OGDEN_RUBBER, *MAT_ARRUDA_BOYCE_RUBBER and
*MAT_MOONEY-RIVLIN_RUBBER, by name or number.

Cards of eight fields of 10 columns, 20 where the keyword ends in + or the deck is LONG=Y, or parted by commas; $ begins
a comment; _TITLE adds a line before the first card. Terms G_i, beta_i of 77 and 127 are a linear viscous stress next to
the law; as shares G_i/(mu_0 + sum G_i) of the whole stress they are the card's series at small strain.

Source: as `matcal.record.exporters.lsdyna`; LS-DYNA Keyword User's Manual, Volume II.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from matcal.laws.law import Law
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.ogden import Ogden
from matcal.record.exporters.base import Units
from matcal.record.importers.material_parts import (
    DeckMaterial,
    DeckProblem,
    Materials,
    hyperfoam,
    made,
    polynomial,
    prony_of,
    real,
    volume_note,
    with_bulk,
    with_nu,
)

_FIELDS, _WIDTH, _LONG = 8, 10, 20
_C = ("10", "01", "11", "20", "02", "30")
_LEAST_NU = 0.49  # from which on Mooney's energy of the stretches themselves is that of the stretches without volume


@dataclass(frozen=True)
class Keyword:
    """A keyword with its cards."""

    line: int
    name: str  # without its + or -, and without _TITLE
    title: str
    cards: tuple[tuple[int, tuple[str, ...]], ...]  # line, eight fields

    def values(self, card: int, count: int = _FIELDS) -> list[float]:
        """Numbers of a card; DeckProblem where the deck ends before it."""
        if card >= len(self.cards):
            raise DeckProblem(self.line, f"*{self.name} ends after {len(self.cards)} cards.")
        line, fields = self.cards[card]
        return [real(field, line) for field in fields[:count]]


def recognised(text: str) -> bool:
    """Whether a line of the text is a material's keyword of this program."""
    return any(line.upper().startswith("*MAT_") for line in text.splitlines())


def materials(text: str) -> Materials:
    """Every material with a law, by its title, or else its number."""
    found = [part for part in _keywords(text) if part.name in _KINDS]
    names = [part.title or part.cards[0][1][0] or "1" if part.cards else "1" for part in found]
    return {name if names.count(name) == 1 else f"{name} in line {part.line}": partial(_material, part)
            for name, part in zip(names, found, strict=True)}


def _keywords(text: str) -> Iterator[Keyword]:
    """Keywords with their cards."""
    head, at, cards, long = "", 0, list[tuple[int, str]](), False
    for number, line in enumerate([*text.splitlines(), "*END"], 1):
        if line.startswith("$"):
            continue
        if line.startswith("*"):
            if head.startswith("*MAT_"):
                yield _keyword(head, at, cards, long)
            head, at, cards = line.split()[0].upper(), number, []
            plain = "".join(line.upper().split())
            long = long or (plain.startswith("*KEYWORD") and "LONG=Y" in plain)
        elif line.strip():
            cards.append((number, line.expandtabs()))


def _keyword(head: str, line: int, cards: Sequence[tuple[int, str]], long: bool) -> Keyword:
    width = _LONG if head.endswith("+") or (long and not head.endswith("-")) else _WIDTH
    name = head[1:].removesuffix("+").removesuffix("-")
    titled = name.endswith("_TITLE")
    title = cards[0][1].strip() if titled and cards else ""
    return Keyword(line, name.removesuffix("_TITLE"), title, tuple(
        (at, _fields(card, width)) for at, card in cards[titled:]))


def _fields(card: str, width: int) -> tuple[str, ...]:
    parts = card.split(",") if "," in card else [card[k * width:(k + 1) * width] for k in range(_FIELDS)]
    return tuple(part.strip() for part in [*parts, *[""] * _FIELDS][:_FIELDS])


def _material(part: Keyword, units: Units) -> DeckMaterial:
    return _KINDS[part.name](part, units)


def _hill_foam(part: Keyword, units: Units) -> DeckMaterial:
    n, curve = part.values(0)[3], part.values(0)[5]
    if curve:
        raise DeckProblem(part.cards[0][0], "LCID names a curve that LS-DYNA fits. Give the curve to `matcal fit`.")
    pairs = [(c, b) for c, b in zip(part.values(1), part.values(2), strict=True) if c]
    softened = ("Left out: the softening R, M.",) if len(part.cards) > 3 and any(part.values(3, 2)) else ()
    law = hyperfoam(part.line, [c * b / 2 / units.stress for c, b in pairs], [b for _, b in pairs],
                    [n / (1 + 2 * n)] * len(pairs))
    return DeckMaterial(law, notes=softened)


def _arruda_boyce(part: Keyword, units: Units) -> DeckMaterial:
    _, _, kappa, mu, links = part.values(0, 5)
    law = made(part.line, ArrudaBoyce, mu / units.stress, max(links, 0.0) ** 0.5)
    law = with_bulk(part.line, law, kappa / units.stress) if kappa else law
    return _relaxing(part, law, 2, units, volume_note(law, f"*{part.name}"))


def _mooney(part: Keyword, units: Units) -> DeckMaterial:
    a, b, nu = part.values(0)[2:5]
    if nu < _LEAST_NU:
        raise DeckProblem(part.cards[0][0], f"*{part.name} with a Poisson's ratio below {_LEAST_NU:g} has invariants "
                                            "of the stretches themselves, and the card of those without volume.")
    return DeckMaterial(with_nu(part.line, made(part.line, MooneyRivlin, a / units.stress, b / units.stress), nu))


def _rubber(part: Keyword, units: Units) -> DeckMaterial:
    """77: constants of the polynomial, or of Ogden's law."""
    _, _, nu, fitted, _, *damping = part.values(0, 7)
    line, ogden = part.line, part.name in _OGDEN
    if fitted:
        raise DeckProblem(part.cards[0][0], "N > 0 has LS-DYNA fit a curve. Give the curve to `matcal fit`.")
    if ogden:
        pairs = [(m * a / 2 / units.stress, a) for m, a in zip(part.values(1), part.values(2), strict=True) if m]
        law: Law = made(line, Ogden, [mu for mu, _ in pairs], [a for _, a in pairs])
    else:
        law = polynomial(line, {ij: v / units.stress for ij, v in zip(_C, part.values(1), strict=False)})
    law, notes = with_nu(line, law, nu), ("Left out: the damping G, SIGF.",) if any(damping) else ()
    return _relaxing(part, law, 3 if ogden else 2, units, notes)


def _relaxing(part: Keyword, law: Law, first: int, units: Units, notes: tuple[str, ...]) -> DeckMaterial:
    """The long-term law with the viscous terms of the cards from `first` on."""
    terms = [part.values(k, 3) for k in range(first, len(part.cards))]
    if any(form for _, _, form in terms) or any(rate <= 0 for modulus, rate, _ in terms if modulus):
        raise DeckProblem(part.line, "viscous terms are read with a positive BETAI and VFLAG 0 alone.")
    if not any(modulus for modulus, *_ in terms):
        return DeckMaterial(law, notes=notes)
    whole = law.mu_0_Pa + sum(modulus for modulus, *_ in terms) / units.stress
    prony, more = prony_of(part.line, law, [(modulus / units.stress / whole, 1 / rate / units.time)
                                            for modulus, rate, _ in terms if modulus])
    return DeckMaterial(law, prony, notes=(*notes, *more, "Relaxation: terms G_i of a linear viscous stress became "
                                           "shares of the whole stress, the same at small strain alone."))


_OGDEN = ("MAT_OGDEN_RUBBER", "MAT_077_O")
_KINDS: dict[str, Callable[[Keyword, Units], DeckMaterial]] = {
    **dict.fromkeys(("MAT_HYPERELASTIC_RUBBER", "MAT_077_H", *_OGDEN), _rubber),
    **dict.fromkeys(("MAT_HILL_FOAM", "MAT_177"), _hill_foam),
    **dict.fromkeys(("MAT_ARRUDA_BOYCE_RUBBER", "MAT_127"), _arruda_boyce),
    **dict.fromkeys(("MAT_MOONEY-RIVLIN_RUBBER", "MAT_027"), _mooney)}
