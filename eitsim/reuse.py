"""Which table of load paths serves a scene or a design, when it is worth its cost, and what a touch from it is said
to cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, astuple, replace
from typing import Any

import numpy as np

from eitsim import cache
from eitsim.design import Design, drawn_keys, example, right_scenes
from eitsim.draws import draw_of
from eitsim.near_rim import rim_problem
from eitsim.path import Deviation
from eitsim.plan import law_of, near_rim
from eitsim.results import Decision, Touch
from eitsim.rim_table import RimTable, changed_diameters, near_rim_from, within
from eitsim.rim_tabulate import GRID, build_rim
from eitsim.scene import Punch, Scene
from eitsim.table import Shape, Table, shape_of, touch_from
from eitsim.tabulate import DEPTHS, Run, build
from matcal.card import MaterialCard
from matcal.hyperfoam import Hyperfoam

# Touches from which on a table repays its cost, for each of its diameters.
REPAYS = 60
# Most diameters that are each solved; a choice of more is served as a range.
_MOST = 9
# Part of the wanted signal error that a table's own may use up.
_SHARE = 0.25
# Drawn keys that one table serves, whatever their values.
_SERVED = {("punch", "x_mm"), ("punch", "y_mm"), ("punch", "force_N"), ("punch", "depth_mm"), ("punch", "conductor"),
           ("punch", "contact_impedance_Ohm_m2"), ("punch", "diameter_mm"), ("skin", "thickness_um"),
           ("accuracy", "signal")}
_APART = ("electrodes", "drive")
# Arrays of a table and of what the rim changes.
_PATHS = ("depths", "radius", "values", "slopes", "told")
_CHANGES = ("diameters", "gaps", "depths", "radius", "share", "fields", "numbers", "told")
# Touches near the rim from which on a table of changes repays its cost, and rows by which their part is told.
RIM_REPAYS, _ROWS = 25, 200
# What a touch from a table may be off over the largest deviation that was measured when it was made: of 40 random
# touches 35 were within once the largest, 39 within twice.
_SAFETY = 2.0
# Part of the wanted signal error that a table of changes may use up beside the paths.
_RIM_SHARE = 1.0


def table_for(shape: Shape, run: Run = map, *, rim: bool = False) -> tuple[Table, str]:
    """The table of a shape, with what the rim changes where that is asked for, from the cache or solved and put there,
    and a note where the cache cannot be used."""
    key = {"shape": asdict(shape), "depths": DEPTHS}
    arrays, note = cache.kept(cache.key_of(key), lambda: _arrays(build(shape, run, DEPTHS)))
    part = {name: np.asarray(arrays[name]) for name in _PATHS}
    table = Table(shape, part["depths"], part["radius"], part["values"], part["slopes"], part["told"],
                  Deviation(*arrays["error"].tolist()), int(arrays["checks"]), float(arrays["cpu_s"]))
    if not rim:
        return table, note
    key |= {"rim": asdict(GRID)}
    arrays, note = cache.kept(cache.key_of(key), lambda: _rim_arrays(build_rim(table, run, GRID)))
    part = {name: np.asarray(arrays[name]) for name in _CHANGES}
    return replace(table, rim=RimTable(**part, cpu_s=float(arrays["cpu_s"]))), note


def _arrays(table: Table) -> dict[str, Any]:
    kept = {name: getattr(table, name) for name in _PATHS}
    return kept | {"error": np.array(astuple(table.error)), "checks": np.array(table.checks),
                   "cpu_s": np.array(table.cpu_s)}


def _rim_arrays(rim: RimTable) -> dict[str, Any]:
    kept = {name: getattr(rim, name) for name in _CHANGES}
    return kept | {"cpu_s": np.array(rim.cpu_s)}


def scene_shape(scene: Scene, card: MaterialCard) -> Shape:
    """The shape that serves every force on a scene's punch; ValueError where load paths are not reused."""
    law = law_of(scene, card)
    try:
        return _shape(scene, law, sorted({punch.diameter_m for punch in scene.punches}), False)
    except ValueError as error:
        raise ValueError(f"{error} Leave out --reuse: the touch is then solved afresh.") from None


def design_shape(design: Design, card: MaterialCard) -> Shape:
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
    first = example(design)
    return _shape(first, law_of(first, card), diameters if not spans else [diameters[0], diameters[-1]], spans)


def diameters_of(shape: Shape) -> dict[str, Any]:
    """What of a design's shape its later rows may change, as JSON."""
    return {"diameters": list(shape.diameters), "spans": shape.spans}


def with_diameters(shape: Shape, kept: Mapping[str, Any] | None) -> Shape:
    """A shape with the diameters of `diameters_of`, so that rows that a sweep has grown by change no table; touches
    beyond them are solved afresh. None: the shape itself."""
    return shape if kept is None else replace(shape, diameters=tuple(kept["diameters"]), spans=kept["spans"])


def _diameters(punch: Mapping[str, Any]) -> tuple[list[float], bool]:
    """Diameters, m, of a punch of a design: all, or the ends of their range."""
    default = Punch().diameter_m * 1e3
    given = punch.get("diameter_mm", default)
    draw = draw_of("diameter_mm in [punch]", given)
    if draw is None:
        return [float(given) / 1e3], False
    if draw.values:
        return [float(default if d is None else d) / 1e3 for d in draw.values], False
    if not np.all(np.isfinite(draw.ends)):
        raise ValueError("diameter_mm in [punch] is drawn from a distribution without ends, and a table of load paths "
                         "needs a range.")
    return [end / 1e3 for end in draw.ends], True


def _shape(scene: Scene, law: Hyperfoam, diameters_m: list[float], spans: bool) -> Shape:
    if scene.hold.time_s:
        raise ValueError("a hold (time_s in [hold]) is solved in time, not along a load path.")
    for punch in scene.punches:
        if punch.friction != "none":
            raise ValueError(f"friction = \"{punch.friction}\" in [punch]: load paths are stored for punches without "
                             "friction only.")
        if punch.profile != "flat":
            raise ValueError(f"profile = \"{punch.profile}\" in [punch]: load paths of spheres and cones are not "
                             "stored.")
    shapes = {shape_of(law, scene.body, punch, scene.skin.strain, diameters_m, spans=spans) for punch in scene.punches}
    if len(shapes) > 1:
        raise ValueError("the punches differ in more than their diameters, and a table of load paths serves one kind.")
    return shapes.pop()


def repays(design: Design, shape: Shape) -> bool:
    """Whether solving a design's touches afresh costs more than the table."""
    return design.scenes * len(example(design).punches) >= REPAYS * len(shape.solved)


def rim_repays(design: Design, shape: Shape) -> bool:
    """Whether solving a design's touches near the rim afresh costs more than a table of what the rim changes."""
    rows = list(right_scenes(design, _ROWS))
    near = sum(not rim_problem(s.body, p) for s in rows for p in s.punches if near_rim(s, p))
    return near * design.scenes >= RIM_REPAYS * len(changed_diameters(shape)) * len(rows)


def fine_enough_for(design: Design, table: Table) -> tuple[Table | None, str]:
    """What of a table is fine enough for any row of a design, and why the rest is not, whose touches are then solved
    afresh."""
    wanted = max((scene.accuracy.signal for scene in right_scenes(design, _ROWS)), default=np.inf)
    if table.error.signal > _SHARE * wanted:
        return None, (f"no table: its signals are up to {table.error.signal:.1e} off, more than {_SHARE:.0%} of the "
                      f"{wanted:g} wanted")
    return _rim_fine_enough(table, _RIM_SHARE * wanted) if table.rim is not None else (table, "")


def _rim_fine_enough(table: Table, allowed: float) -> tuple[Table, str]:
    """The table with the cells of gap and depth alone in which what the rim changes is near enough, and in words how
    many of them are not."""
    assert table.rim is not None
    kept = within(table.rim, allowed)
    before, after = (np.isfinite(rim.told).all(axis=-1) for rim in (table.rim, kept))
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


def served(table: Table | None, law: Hyperfoam, scene: Scene) -> tuple[Touch | None, ...]:
    """The touches of a scene that a table holds to the wanted error; None for each that is to be solved afresh."""
    if table is None or scene.hold.time_s or table.error.signal > _SHARE * scene.accuracy.signal:
        return (None,) * len(scene.punches)
    return tuple(_served(table, law, scene, punch) for punch in scene.punches)


def _served(table: Table, law: Hyperfoam, scene: Scene, punch: Punch) -> Touch | None:
    touch = touch_from(table, law, scene.body, punch, scene.skin.strain)
    if touch is None or not near_rim(scene, punch):
        return touch
    rim = None if table.rim is None else within(table.rim, _RIM_SHARE * scene.accuracy.signal)
    return near_rim_from(replace(table, rim=rim), touch, scene.body, punch)


def decision(table: Table, touch: Touch, thickness_m: float) -> Decision:
    """What a touch from a table may cost, as measured when it was made."""
    error = table.error
    ends = [f"{d * thickness_m * 1e3:g}" for d in table.shape.diameters]
    where = f"{ends[0]} to {ends[-1]} mm" if table.shape.spans else f"{', '.join(ends)} mm"
    if table.laws > 1:
        where += (f", for this law a weighted mean of those of {table.laws} drawn laws (what the rim changes that of "
                  "one)")
    bound, rim = max(error.depth, error.signal), ""
    if touch.rim is not None and touch.rim.told is not None:
        depth, signal = touch.rim.told
        bound += max(depth, signal)
        rim = (f"; what the rim changes, from a table too, was at most {depth:.1e} off in depth and {signal:.1e} in "
               "signal about this gap and depth")
    bound *= _SAFETY
    told = (f"the bound is {_SAFETY:g} times the larger of depth and response; the table took {table.whole_cpu_s:.0f} "
            "CPU s, once, not counted in the cost of a touch")
    return Decision("load path reused", f"depth, pressure and surface are cubics along stored paths of punches of "
                    f"{where}; of {table.checks} touches solved afresh between its nodes the depth was at most "
                    f"{error.depth:.1e} off, the dipole response {error.signal:.1e}, and the surface's stretches "
                    f"{error.strain:.1e} in L2{rim}; {told}", bound, strain_bound=_SAFETY * error.strain)
