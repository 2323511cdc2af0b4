"""What the plans of a design's rows leave out, and the error that it may cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from eitsim.design import Design, right_scenes
from eitsim.plan import make_plan
from eitsim.results import Decision
from eitsim.scene import Scene
from matcal.card import MaterialCard

# Rows whose plans are made.
_ROWS = 64
LEFT_OUT = "left_out"


@dataclass(frozen=True)
class Omission:
    """A decision of plans that may cost accuracy; a stored load path is none of them."""

    decision: str
    # of the row where it may cost most
    reason: str
    # relative error of the signal that it may cost there
    error_bound: float
    # whether what it costs is unknown
    unbounded: bool
    # rows that it is made in, of all that were looked at
    rows: int
    of: int


def omissions(design: Design, card: MaterialCard, *, exact: bool) -> list[Omission]:
    """What the first rows leave out, the costliest first."""
    found: dict[str, Omission] = {}
    scenes = list(right_scenes(design, _ROWS))
    for scene in scenes:
        for made in _decisions(scene, card, exact):
            if made.error_bound > 0 or made.unbounded:
                one = Omission(made.decision, made.reason, made.error_bound, made.unbounded, 1, len(scenes))
                found[made.decision] = _worse(found[made.decision], one) if made.decision in found else one
    return sorted(found.values(), key=lambda one: (-one.error_bound, one.decision))


def _decisions(scene: Scene, card: MaterialCard, exact: bool) -> tuple[Decision, ...]:
    """None of a row that is refused since the card lacks what it needs."""
    try:
        return make_plan(scene, card, exact=exact).decisions
    except ValueError:
        return ()


def _worse(old: Omission, new: Omission) -> Omission:
    return replace(new if new.error_bound > old.error_bound else old, rows=old.rows + 1)


def omissions_of(manifest: Mapping[str, Any]) -> list[Omission]:
    """Those that are on record."""
    return [Omission(**one) for one in manifest.get(LEFT_OUT, [])]
