"""How the touches of a sweep are solved: afresh, or from load paths that are solved before its rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from eitsim.mechanics.load_paths.law_family import Family, central_of
from eitsim.mechanics.load_paths.types import Table
from eitsim.simulation.reuse import (
    table_for,
)
from eitsim.sweeps.design.card_draws import Cards, foam_varies
from eitsim.sweeps.design.design import Design
from eitsim.sweeps.run.family_choice import family_for, family_repays, span_for
from eitsim.sweeps.run.table_choice import (
    design_shape,
    diameters_of,
    fine_enough_for,
    repays,
    rim_repays,
    with_diameters,
)
from touchcal.errors import NotConverged
from touchcal.parallel.checkpoint import CheckpointedMap
from touchcal.parallel.pool import WorkerPool


def method_for(design: Design, cards: Cards, reuse: bool | None, exact: bool) -> dict[str, Any]:
    """How a new folder's touches are to be solved, as JSON: exact, reuse, rim, the reason, and the shape of its paths.

    ValueError where reuse is asked for and the design has no use for a table.
    """
    if exact or reuse is False:
        return {"exact": exact, "reuse": False, "rim": False, "reason": "as asked for"}
    try:
        if foam_varies(cards):
            shape, span = span_for(design, cards)
            repaid = family_repays(design, shape, span)
        else:
            shape = design_shape(design, cards.card)
            repaid = repays(design, shape)
    except ValueError as error:
        if reuse:
            raise ValueError(f"{error} Leave out --reuse: every touch is then solved afresh.") from None
        return {"exact": False, "reuse": False, "rim": False, "reason": str(error)}
    used = bool(reuse or repaid)
    why = ("as asked for" if reuse else "a table of load paths repays its cost" if repaid else
           "a table of load paths costs more than so few touches (--reuse makes one)")
    found = {"exact": False, "reuse": used, "rim": used and rim_repays(design, shape), "reason": why}
    return found | ({"shape": diameters_of(shape)} if used else {})


def table_of(design: Design, cards: Cards, pool: WorkerPool,
             method: Mapping[str, Any]) -> tuple[Table | Family | None, str]:
    """The table of a design, or the family of its drawn laws, and a note; none where paths are not found or too rough,
    or were not when the folder was started; PoolUnavailable where workers were lost on it again and again."""
    before = method.get("table", {"used": True, "rim": method["rim"], "note": ""})
    if not before["used"]:
        return None, before["note"]
    kept = method.get("shape")
    if foam_varies(cards):
        shape, span = span_for(design, cards)
        make = partial(family_for, with_diameters(shape, kept), span)
    else:
        make = partial(table_for, with_diameters(design_shape(design, cards.card), kept))
    checkpointed = CheckpointedMap(pool)
    found, note = _made(make, checkpointed, before["rim"])
    checkpointed.forget()
    table = central_of(found)
    if table is None:
        return None, note
    fine, rough = fine_enough_for(design, table)
    note = "; ".join(part for part in (before["note"], note, rough) if part)
    return (replace(found, table=fine) if isinstance(found, Family) and fine is not None else fine), note


def _made(make: Callable[..., tuple[Table | Family, str]], run: CheckpointedMap,
          rim: bool) -> tuple[Table | Family | None, str]:
    try:
        found, note = make(run)
    except NotConverged as error:
        return None, f"no table: {error}"
    if not rim:
        return found, note
    try:
        return make(run, rim=True)
    except NotConverged as error:
        return found, f"no table of what the rim changes: {error}"


def describe_method(method: Mapping[str, Any], found: Table | Family | None, note: str) -> str:
    """How touches are solved, in words, with what a table of load paths may be off."""
    table = central_of(found)
    if table is None:
        how = "exactly" if method["exact"] else "afresh"
        return f"every touch solved {how}: {note or method['reason']}"
    error, rim = table.error, "those near the rim or beyond the table afresh"
    if table.rim is not None:
        rim = (f"near the rim another {table.rim.error.depth:.1e} and {table.rim.error.signal:.1e}; those beyond the "
               "tables afresh")
    paths = f"{len(table.shape.solved)} load paths"
    if isinstance(found, Family) and found.span.chosen:
        paths += f" of a central law and what {len(found.span.chosen)} other drawn laws change of them"
    return (f"touches from a table of {paths} ({table.whole_cpu_s:.0f} CPU s, once, not counted in the rows' cpu_s), "
            f"at most {error.depth:.1e} off in depth and {error.signal:.1e} in signal; {rim}"
            + (f"; {note}" if note else ""))
