"""What a design will not give, told before its rows are solved."""

from __future__ import annotations

from collections.abc import Iterator

from eitsim.design import Design, scene_at
from eitsim.plan import make_plan
from matcal.card import MaterialCard
from matcal.digits import counted

# Rows whose plans are made.
_ROWS = 128


def cautions(design: Design, card: MaterialCard) -> Iterator[str]:
    """Sentences on rows that will be refused, as far as the plans of the first ones tell with the card itself, and on a
    count of Sobol points that loses their balance."""
    rows = min(design.scenes, _ROWS)
    if refused := [reason for index in range(rows) if (reason := _refusal(design, card, index))]:
        yield (f"{len(refused)} of the first {counted(rows, 'scene')} will be refused and become rows without "
               f"readings, the first one so: {refused[0]} Mend the design if it should not draw them.")
    if design.sampler == "sobol" and design.scenes & (design.scenes - 1):
        yield (f"{design.scenes} scenes are no power of two, and Sobol points are balanced for those alone. "
               f"Ask for {1 << design.scenes.bit_length()}, or {1 << design.scenes.bit_length() - 1}.")


def _refusal(design: Design, card: MaterialCard, index: int) -> str:
    try:
        return make_plan(scene_at(design, index), card).refusal
    except ValueError as error:
        return str(error)
