"""Which table of load paths serves a design, and when it is worth its cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from eitsim.mechanics.load_paths.rim_table import changed_diameters, within
from eitsim.mechanics.load_paths.types import DimensionlessProblem, Table
from eitsim.mechanics.rim.solve_near_rim import rim_problem
from eitsim.scene.scene import Punch
from eitsim.simulation.material import material_of
from eitsim.simulation.plan import near_rim
from eitsim.simulation.reuse import RIM_SHARE, TABLE_SHARE, shape_for
from eitsim.sweeps.design.design import Design, drawn_keys, representative_scene, valid_scenes
from eitsim.sweeps.design.distributions import distribution_of
from matcal.card import MaterialCard

# Touches from which on a table repays its cost, for each of its diameters.
REPAYS = 60
# Most diameters that are each solved; a choice of more is served as a range.
_MOST = 9
# Drawn keys that one table serves, whatever their values.
_SERVED = {("punch", "x_mm"), ("punch", "y_mm"), ("punch", "force_N"), ("punch", "depth_mm"), ("punch", "conductor"),
           ("punch", "contact_impedance_Ohm_m2"), ("punch", "diameter_mm"), ("skin", "thickness_um"),
           ("accuracy", "signal")}
_APART = ("electrodes", "drive")
# Touches near the rim from which on a table of changes repays its cost, and rows by which their part is told.
RIM_REPAYS, _ROWS = 25, 200


def design_shape(design: Design, card: MaterialCard) -> DimensionlessProblem:
    """The shape that serves every row of a design, whatever their number; ValueError where none does."""
    for table, key in drawn_keys(design):
        if table not in _APART and (table, key) not in _SERVED:
            raise ValueError(f"{key} in [{table}] is drawn, and a table of load paths holds one value of it.")
    punches = design.tables.get("punch", {})
    found = [_diameters(p) for p in (punches if isinstance(punches, list) else [punches])]
    diameters = sorted({d for values, _ in found for d in values})
    spans = any(spans for _, spans in found) or len(diameters) > _MOST
    if spans and diameters[0] == diameters[-1]:
        diameters, spans = diameters[:1], False
    first = representative_scene(design)
    ends = diameters if not spans else [diameters[0], diameters[-1]]
    return shape_for(first, material_of(first, card).law, ends, spans)


def diameters_of(shape: DimensionlessProblem) -> dict[str, Any]:
    """What of a design's shape its later rows may change, as JSON."""
    return {"diameters": list(shape.diameters), "spans": shape.spans}


def with_diameters(shape: DimensionlessProblem, kept: Mapping[str, Any] | None) -> DimensionlessProblem:
    """A shape with the diameters of `diameters_of`, so that rows that a sweep has grown by change no table; touches
    beyond them are solved afresh. None: the shape itself."""
    return shape if kept is None else replace(shape, diameters=tuple(kept["diameters"]), spans=kept["spans"])


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
    """Whether solving a design's touches afresh costs more than the table."""
    return design.scenes * len(representative_scene(design).punches) >= REPAYS * len(shape.solved)


def rim_repays(design: Design, shape: DimensionlessProblem) -> bool:
    """Whether solving a design's touches near the rim afresh costs more than a table of what the rim changes."""
    rows = list(valid_scenes(design, _ROWS))
    near = sum(not rim_problem(s.body, p) for s in rows for p in s.punches if near_rim(s, p))
    return near * design.scenes >= RIM_REPAYS * len(changed_diameters(shape)) * len(rows)


def fine_enough_for(design: Design, table: Table) -> tuple[Table | None, str]:
    """What of a table is fine enough for any row of a design, and why the rest is not, whose touches are then solved
    afresh."""
    wanted = max((scene.accuracy.signal for scene in valid_scenes(design, _ROWS)), default=np.inf)
    if table.error.signal > TABLE_SHARE * wanted:
        return None, (
            f"no table: its signals are up to {table.error.signal:.1e} off, more than {TABLE_SHARE:.0%} of the "
            f"{wanted:g} wanted"
        )
    return _rim_fine_enough(table, RIM_SHARE * wanted) if table.rim is not None else (table, "")


def _rim_fine_enough(table: Table, allowed: float) -> tuple[Table, str]:
    """The table with the cells of gap and depth alone in which what the rim changes is near enough, and in words how
    many of them are not."""
    assert table.rim is not None
    kept = within(table.rim, allowed)
    before, after = (np.isfinite(rim.error_estimate).all(axis=-1) for rim in (table.rim, kept))
    if not after.any():
        return replace(table, rim=None), (f"no table of what the rim changes: its signals are up to "
                                          f"{table.rim.error.signal:.1e} off, more than the {allowed:g} wanted")
    if after.all():
        return replace(table, rim=kept), ""
    off, left = int(np.sum(before & ~after)), int(np.sum(~after))
    reasons = [f"in {left - off} since no change was found there"] if left > off else []
    if off:
        reasons.append(f"in {off} since the table is more than {allowed:g} off, and more than touches solved afresh "
                       "tell")
    return replace(table, rim=kept), (f"touches in {left} of {after.size} cells of gap and depth near the rim are "
                                      f"solved afresh, {' and '.join(reasons)}")
