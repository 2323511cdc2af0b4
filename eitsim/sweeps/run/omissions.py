"""What the plans of a design's rows leave out, and the error that it may cost."""

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from eitsim.scene.choices import Kind
from eitsim.scene.curved.curved_scene import AnyScene, CurvedScene
from eitsim.scene.results import Decision, Plan
from eitsim.simulation import words
from eitsim.simulation.curved.curved_plan import curved_plan
from eitsim.simulation.material import material_of
from eitsim.simulation.plan import make_plan
from eitsim.sweeps.design.card_draws import Cards, card_at, count_in_use, held_by
from eitsim.sweeps.design.design import Design, card_number, scene_at
from matcal.card import MaterialCard
from touchcal.choice import Choice
from touchcal.number_words import counted

# Rows whose plans are made.
_ROWS = 64
LEFT_OUT = "left_out"
_DRAWN_ROWS = 128  # Rows whose plans are made.


@dataclass(frozen=True)
class Omission:
    """A kind of decision of plans that may cost accuracy; a stored load path is none of them."""

    # in words, of the row where it may cost most
    decision: str
    reason: str
    error_bound: float  # relative error of the signal that it may cost there
    unbounded: bool  # whether what it costs is unknown
    # rows that it is made in, of all that were looked at
    rows: int
    of: int
    kind: str = ""  # its Kind; empty in data sets of earlier versions


def omissions(design: Design, cards: Cards, *, exact: bool) -> list[Omission]:
    """What the first rows leave out, each with its own card, the costliest first."""
    plans = list(_plans(design, cards, exact))
    costly = [[made for made in decisions if (made.error_bound > 0 or made.unbounded) and not (
        cards.draws is not None and made.kind is Kind.ONE_CARD)] for decisions in plans]
    rows = Counter(kind for decisions in costly for kind in {made.kind for made in decisions})
    worst: dict[str, Decision] = {}
    for made in itertools.chain.from_iterable(costly):
        if made.kind not in worst or made.error_bound > worst[made.kind].error_bound:
            worst[made.kind] = made
    drawn = {made.kind: made for made in _of_drawn_cards(design, cards)}
    return sorted((Omission(made.decision, made.reason, made.error_bound, made.unbounded, rows.get(kind, len(plans)),
                            len(plans), kind) for kind, made in (worst | drawn).items()),
                  key=lambda one: (-one.error_bound, one.decision))


def _plans(design: Design, cards: Cards, exact: bool) -> Iterator[tuple[Decision, ...]]:
    """Decisions of the first rows that are scenes; none of a row that is refused since the card lacks what it needs."""
    for index in range(min(design.scenes, _ROWS)):
        try:
            scene = scene_at(design, index)
        except ValueError:
            continue
        try:
            yield _plan(scene, card_at(cards, card_number(design, index)), exact=exact, bodies=exact).decisions
        except ValueError:
            yield ()


def _plan(scene: AnyScene, card: MaterialCard, *, exact: bool = False, bodies: bool = True) -> Plan:
    if isinstance(scene, CurvedScene):
        return curved_plan(scene, material_of(scene.flat, card))
    return make_plan(scene, card, exact=exact, bodies=bodies)


def _of_drawn_cards(design: Design, cards: Cards) -> Iterator[Decision]:
    """What drawing cards leaves out of the material, by their number."""
    if cards.draws is None:
        return
    used = count_in_use(cards, card_number(design, design.scenes - 1) + 1)
    varying = " and ".join(held_by(cards.draws))
    yield words.decision(Choice(Kind.DRAWN_CARDS, {"count": used, "varying": varying, "spread": used**-0.5,
                                                    "further": cards.further}, None))


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
        return _plan(scene_at(design, index), card).refusal
    except ValueError as error:
        return str(error)
