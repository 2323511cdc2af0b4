"""What the plans of a design's rows leave out, and the error that it may cost."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from eitsim.scene.results import Decision
from eitsim.simulation.plan import ONE_CARD, make_plan
from eitsim.sweeps.design.card_draws import Cards, card_at, count_in_use, held_by
from eitsim.sweeps.design.design import Design, card_number, scene_at
from matcal.card import MaterialCard
from touchcal.number_words import counted

# Rows whose plans are made.
_ROWS = 64
LEFT_OUT = "left_out"
_DRAWN_ROWS = 128  # Rows whose plans are made.


@dataclass(frozen=True)
class Omission:
    """A decision of plans that may cost accuracy; a stored load path is none of them."""

    decision: str
    reason: str  # of the row where it may cost most
    error_bound: float  # relative error of the signal that it may cost there
    unbounded: bool  # whether what it costs is unknown
    # rows that it is made in, of all that were looked at
    rows: int
    of: int


def omissions(design: Design, cards: Cards, *, exact: bool) -> list[Omission]:
    """What the first rows leave out, each with its own card, the costliest first."""
    found: dict[str, Omission] = {}
    plans = list(_plans(design, cards, exact))
    for decisions in plans:
        for made in decisions:
            if (made.error_bound > 0 or made.unbounded) and (cards.draws is None or made.decision != ONE_CARD):
                one = Omission(made.decision, made.reason, made.error_bound, made.unbounded, 1, len(plans))
                if (old := found.get(made.decision)) is not None:
                    one = replace(one if one.error_bound > old.error_bound else old, rows=old.rows + 1)
                found[made.decision] = one
    whole = [Omission(made.decision, made.reason, made.error_bound, made.unbounded, len(plans), len(plans))
             for made in _of_drawn_cards(design, cards)]
    return sorted([*found.values(), *whole], key=lambda one: (-one.error_bound, one.decision))


def _plans(design: Design, cards: Cards, exact: bool) -> Iterator[tuple[Decision, ...]]:
    """Decisions of the first rows that are scenes; none of a row that is refused since the card lacks what it needs."""
    for index in range(min(design.scenes, _ROWS)):
        try:
            scene = scene_at(design, index)
        except ValueError:
            continue
        try:
            yield make_plan(scene, card_at(cards, card_number(design, index)), exact=exact).decisions
        except ValueError:
            yield ()


def _of_drawn_cards(design: Design, cards: Cards) -> Iterator[Decision]:
    """What drawing cards leaves out of the material, by their number."""
    if cards.draws is None:
        return
    used = count_in_use(cards, card_number(design, design.scenes - 1) + 1)
    varying = " and ".join(held_by(cards.draws))
    yield Decision(f"{used} cards drawn from the posterior", f"{varying} vary as its draws do, other parts are the "
                   f"card's own and taken as exact; a mean over cards is off by 1/sqrt({used}) = {used**-0.5:.2g} of "
                   "their spread, what the posterior does not hold by what is unknown; not in the bound", 0.0,
                   unbounded=True)


def omissions_of(manifest: Mapping[str, Any]) -> list[Omission]:
    """Those that are on record."""
    return [Omission(**one) for one in manifest.get(LEFT_OUT, [])]


def cautions(design: Design, card: MaterialCard) -> Iterator[str]:
    """Sentences on rows that will be refused, as far as the plans of the first ones tell with the card itself, and on a
    count of Sobol points that loses their balance."""
    rows = min(design.scenes, _DRAWN_ROWS)
    if refused := [reason for index in range(rows) if (reason := _refusal(design, card, index))]:
        yield (f"{len(refused)} of the first {counted(rows, 'scene')} will be refused and become rows without "
               f"readings, the first one so: {refused[0]} Fix the design if it should not draw them.")
    if design.sampler == "sobol" and design.scenes & (design.scenes - 1):
        yield (f"{design.scenes} scenes are no power of two, and Sobol points are balanced for those alone. "
               f"Ask for {1 << design.scenes.bit_length()}, or {1 << design.scenes.bit_length() - 1}.")


def _refusal(design: Design, card: MaterialCard, index: int) -> str:
    try:
        return make_plan(scene_at(design, index), card).refusal
    except ValueError as error:
        return str(error)
