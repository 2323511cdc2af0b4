"""How the touches of a sweep are solved: each from rest, or from a table of load paths that is solved before its rows;
and when that is worth its cost."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from eitsim.mechanics.curved.moved_touches import MovedShape, MovedTable
from eitsim.mechanics.load_paths.rim_table import changed_diameters, within
from eitsim.mechanics.load_paths.table import with_diameters
from eitsim.mechanics.load_paths.types import DimensionlessProblem, Table
from eitsim.scene.curved.curved_scene import is_curved
from eitsim.scene.scene import Punch, Scene
from eitsim.simulation.build_rim_table import GRID
from eitsim.simulation.choose import TABLE_SHARE, tabled_near_edge
from eitsim.simulation.material import material_of
from eitsim.simulation.reuse import shape_for, table_for
from eitsim.simulation.routes.nearest_alone import RIM_SHARE
from eitsim.sweeps.design.card_draws import Cards, foam_varies
from eitsim.sweeps.design.design import Design, drawn_keys, flat_scene, representative_scene, valid_scenes
from eitsim.sweeps.design.distributions import distribution_of
from eitsim.sweeps.run.moved_table_choice import WHAT, curved_table, described, moved_repays, moved_shape
from matcal.card import MaterialCard
from matcal.laws.known_laws import law_of
from touchcal.errors import NotConverged
from touchcal.parallel.checkpoint import CheckpointedMap
from touchcal.parallel.pool import WorkerPool

AnyTable = Table | MovedTable

REPAYS = 60  # Touches from which on a table repays its cost, for each of its diameters.
_MOST = 9  # Most diameters that are each solved; a choice of more is served as a range.
# Drawn keys that one table serves, whatever their values.
_SERVED = {("punch", "x_mm"), ("punch", "y_mm"), ("punch", "force_N"), ("punch", "depth_mm"), ("punch", "conductor"),
           ("punch", "contact_impedance_Ohm_m2"), ("punch", "diameter_mm"), ("skin", "thickness_um"),
           ("accuracy", "signal")}
_NEUTRAL = ("electrodes", "drive")  # Tables whose keys change no touch.
# Touches near the rim from which on a table of changes repays its cost, and rows by which their part is found.
RIM_REPAYS, _ROWS = 25, 200


def method_for(design: Design, cards: Cards, reuse: bool | None, exact: bool) -> dict[str, Any]:
    """How a new folder's touches are to be solved, as JSON: exact, reuse, rim, the reason, and the shape of its paths.

    ValueError where reuse is asked for and the design has no use for a table.
    """
    if exact or reuse is False:
        return {"exact": exact, "reuse": False, "rim": False, "reason": "as asked for"}
    shape: MovedShape | DimensionlessProblem
    try:
        shape = moved_shape(design, cards) if is_curved(design.tables) else _shape_of(design, cards)
    except ValueError as error:
        if reuse:
            raise ValueError(f"{error} Leave out --reuse: every touch is then solved directly.") from None
        return {"exact": False, "reuse": False, "rim": False, "reason": str(error)}
    moved = isinstance(shape, MovedShape)
    what, repaid = (WHAT, moved_repays(design, shape)) if moved else ("a table of load paths", repays(design, shape))
    used = bool(reuse or repaid)
    why = ("as asked for" if reuse else f"{what} repays its cost" if repaid else
           f"{what} costs more than so few touches (--reuse makes one)")
    found = {"exact": False, "reuse": used, "rim": not moved and used and rim_repays(design, shape), "reason": why}
    return found | ({"shape": diameters_of(shape)} if used and not moved else {})


def table_of(design: Design, cards: Cards, pool: WorkerPool,
             method: Mapping[str, Any]) -> tuple[AnyTable | None, str]:
    """The table of a design, and a note; none where paths are not found or too rough, or were not when the folder was
    started; PoolUnavailable where workers were lost on it again and again."""
    before = method.get("table", {"used": True, "rim": method["rim"], "note": ""})
    if not before["used"]:
        return None, before["note"]
    checkpointed = CheckpointedMap(pool)
    if is_curved(design.tables):
        curved, note = curved_table(design, cards, checkpointed)
        checkpointed.forget()
        return curved, note
    shape = as_kept(_shape_of(design, cards), method.get("shape"))
    table, note = _made(shape, checkpointed, before["rim"])
    checkpointed.forget()
    if table is None:
        return None, note
    fine, rough = fine_enough_for(design, table)
    return fine, "; ".join(part for part in (before["note"], note, rough) if part)


def shape_of_design(design: Design, cards: Cards) -> DimensionlessProblem | None:
    """The shape of a design's load paths; None on a curved body, where tables are of another kind."""
    return None if is_curved(design.tables) else _shape_of(design, cards)


def _shape_of(design: Design, cards: Cards) -> DimensionlessProblem:
    if foam_varies(cards):
        raise ValueError("[material] draws a law for each row, and a table of load paths holds one.")
    return design_shape(design, cards.card)


def _made(shape: DimensionlessProblem, run: CheckpointedMap, rim: bool) -> tuple[Table | None, str]:
    try:
        table, note = table_for(shape, run)
    except NotConverged as error:
        return None, f"no table: {error}"
    if not rim:
        return table, note
    try:
        return table_for(shape, run, rim=True)
    except NotConverged as error:
        return table, f"no table of what the rim changes: {error}"


def paths_of(table: AnyTable) -> int:
    """How many load paths a table holds."""
    return table.paths if isinstance(table, MovedTable) else len(table.shape.solved)


def describe_method(method: Mapping[str, Any], table: AnyTable | None, note: str, strain: str) -> str:
    """How touches are solved, in words, with what a table of load paths may be off under a skin driven by a strain."""
    if isinstance(table, MovedTable):
        return described(table, strain)
    if table is None:
        how = "exactly" if method["exact"] else "directly"
        return f"every touch solved {how}: {note or method['reason']}"
    error, rim = table.error, "those near the rim or outside the table directly"
    if table.rim is not None:
        off = table.rim.error
        rim = (f"near the rim another {off.depth:.1e} and {off.signal(strain):.1e}; those outside the tables are "
               "solved anew")
    return (f"touches from a table of {len(table.shape.solved)} load paths ({table.whole_cpu_s:.0f} CPU s, once, "
            "not counted in the rows' cpu_s), "
            f"at most {error.depth:.1e} off in depth and {error.signal(strain):.1e} in signal; {rim}"
            + (f"; {note}" if note else ""))


def design_shape(design: Design, card: MaterialCard) -> DimensionlessProblem:
    """The shape that serves every row of a design, whatever their number; ValueError where none does."""
    for table, key in drawn_keys(design):
        if table not in _NEUTRAL and (table, key) not in _SERVED:
            raise ValueError(f"{key} in [{table}] is drawn, and a table of load paths holds one value of it.")
    punches = design.tables.get("punch", {})
    found = [_diameters(p) for p in (punches if isinstance(punches, list) else [punches])]
    diameters = sorted({d for values, _ in found for d in values})
    spans = any(spans for _, spans in found) or len(diameters) > _MOST
    if spans and diameters[0] == diameters[-1]:
        diameters, spans = diameters[:1], False
    first = flat_scene(design)
    if first.skin.fills:
        raise ValueError("a layer that conducts in its volume needs the inside of every touch, and a table of load "
                         "paths holds the surface.")
    ends = diameters if not spans else [diameters[0], diameters[-1]]
    return shape_for(first, material_of(first, card).law, ends, spans)


def diameters_of(shape: DimensionlessProblem) -> dict[str, Any]:
    """What of a design's shape its later rows may change, as JSON."""
    return {"diameters": list(shape.diameters), "spans": shape.spans}


def as_kept(shape: DimensionlessProblem, kept: Mapping[str, Any] | None) -> DimensionlessProblem:
    """A shape with the diameters of `diameters_of`, so that rows that a sweep has grown by change no table; touches
    beyond them are solved directly. None: the shape itself."""
    return shape if kept is None else with_diameters(shape, tuple(kept["diameters"]), spans=kept["spans"])


def _diameters(punch: Mapping[str, Any]) -> tuple[list[float], bool]:
    """Diameters, m, of a punch of a design: all, or the ends of their range."""
    default = Punch().diameter_m * 1e3
    given = punch.get("diameter_mm", default)
    distribution = distribution_of("diameter_mm in [punch]", given)
    if distribution is None:
        return [float(given) / 1e3], False
    if distribution.values:
        return [float(default if d is None else d) / 1e3 for d in distribution.values], False
    if not np.all(np.isfinite(distribution.ends)):
        raise ValueError("diameter_mm in [punch] is drawn from a distribution without ends, and a table of load paths "
                         "needs a range.")
    return [end / 1e3 for end in distribution.ends], True


def repays(design: Design, shape: DimensionlessProblem) -> bool:
    """Whether solving a design's touches directly costs more than the table."""
    return design.scenes * len(representative_scene(design).punches) >= REPAYS * len(shape.solved)


def rim_repays(design: Design, shape: DimensionlessProblem) -> bool:
    """Whether solving a design's touches near the rim directly costs more than a table of what the rim changes; with an
    outline, near straight edges."""
    rows = [scene for scene in valid_scenes(design, _ROWS) if isinstance(scene, Scene)]
    law = law_of(shape.law, shape.parameters)
    near = sum(tabled_near_edge(scene, law, GRID.gaps[-1]) for scene in rows)
    return near * design.scenes >= RIM_REPAYS * len(changed_diameters(shape)) * len(rows)


def fine_enough_for(design: Design, table: Table) -> tuple[Table | None, str]:
    """What of a table is fine enough for any row of a design, and why the rest is not, whose touches are then solved
    directly."""
    requested = max((scene.accuracy.signal for scene in valid_scenes(design, _ROWS)), default=np.inf)
    strain = representative_scene(design).skin.strain
    signal = table.error.signal(strain)
    if signal > TABLE_SHARE * requested:
        return None, (f"no table: its signals are up to {signal:.1e} off, more than {TABLE_SHARE:.0%} of the "
                      f"{requested:g} requested")
    return _rim_fine_enough(table, RIM_SHARE * requested, strain) if table.rim is not None else (table, "")


def _rim_fine_enough(table: Table, allowed: float, strain: str) -> tuple[Table, str]:
    """The table with the cells of gap and depth alone in which what the rim changes is near enough, and in words how
    many of them are not."""
    assert table.rim is not None
    kept = within(table.rim, allowed, strain)
    before, after = (np.isfinite(rim.error_estimate).all(axis=-1) for rim in (table.rim, kept))
    if not after.any():
        return replace(table, rim=None), ("no table of what the rim changes: its signals are up to "
                                          f"{table.rim.error.signal(strain):.1e} off, more than the {allowed:g} "
                                          "requested")
    if after.all():
        return replace(table, rim=kept), ""
    off, left = int(np.sum(before & ~after)), int(np.sum(~after))
    reasons = [f"in {left - off} since no change was found there"] if left > off else []
    if off:
        reasons.append(f"in {off} since the table is more than {allowed:g} off, and more than twice what "
                       "touches solved anew state")
    return replace(table, rim=kept), (f"touches in {left} of {after.size} cells of gap and depth near the rim are "
                                      f"solved anew, {' and '.join(reasons)}")
