"""Which table of load paths serves a scene, and what a touch from it is said to cost."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from eitsim.mechanics.load_paths.build_rim_table import GRID, build_rim
from eitsim.mechanics.load_paths.build_table import DEPTHS, Run, build
from eitsim.mechanics.load_paths.load_path import Deviation
from eitsim.mechanics.load_paths.rim_table import near_rim_from, within
from eitsim.mechanics.load_paths.several_edges import near_edges_from
from eitsim.mechanics.load_paths.table import shape_of, touch_from
from eitsim.mechanics.load_paths.types import DimensionlessProblem, RimTable, Table
from eitsim.scene.results import Decision, Touch, of_strain
from eitsim.scene.scene import Punch, Scene, profile_of
from eitsim.simulation.edge_effects import added_edges_cost, near_rim, several_edges
from eitsim.simulation.material import material_of
from matcal.card import MaterialCard
from matcal.laws.law import Law
from touchcal import cache
from touchcal.arrays import Array
from touchcal.code_version import MECHANICS

TABLE_SHARE = 0.25  # Part of the requested signal error that a table's own may use up.
# Arrays of a table and of what the rim changes.
_PATHS = ("depths", "radius", "values", "slopes", "error_estimate")
_CHANGES = ("diameters", "gaps", "depths", "radius", "share", "fields", "numbers", "error_estimate", "measured")
# What a touch from a table may be off over the largest deviation that was measured when it was made: of 40 random
# touches 35 were within once the largest, 39 within twice.
_SAFETY = 2.0
RIM_SHARE = 1.0  # Part of the requested signal error that a table of changes may use up in addition to the paths.


def table_for(shape: DimensionlessProblem, run: Run = map, *, rim: bool = False) -> tuple[Table, str]:
    """The table of a shape, with what the rim changes where that is asked for, from the cache or solved and put there,
    and a note where the cache cannot be used."""
    key = {"shape": asdict(shape), "depths": DEPTHS, "arrays": _PATHS}
    arrays, note = cache.kept(cache.key_of(key, MECHANICS), lambda: _arrays(build(shape, run, DEPTHS)))
    part = {name: np.asarray(arrays[name]) for name in _PATHS}
    table = Table(shape, part["depths"], part["radius"], part["values"], part["slopes"], part["error_estimate"],
                  deviation_of(arrays["error"]), int(arrays["checks"]), float(arrays["cpu_s"]))
    if not rim:
        return table, note
    key |= {"rim": asdict(GRID), "arrays": _CHANGES}
    arrays, words = cache.kept(cache.key_of(key, MECHANICS), lambda: _kept(build_rim(table, run, GRID), _CHANGES))
    part = {name: np.asarray(arrays[name]) for name in _CHANGES}
    return replace(table, rim=RimTable(**part, cpu_s=float(arrays["cpu_s"]))), note or words


def _arrays(table: Table) -> dict[str, Any]:
    return _kept(table, _PATHS) | {"error": numbers_of(table.error), "checks": np.array(table.checks)}


def numbers_of(error: Deviation) -> Array:
    """(5,) what is kept of a deviation: of depth, signals and stretches."""
    return np.array([error.depth, *error.signals, error.strain])


def deviation_of(kept: Array) -> Deviation:
    """The deviation of which these numbers (5,) are kept."""
    return Deviation(float(kept[0]), kept[1:-1], float(kept[-1]))


def _kept(table: Table | RimTable, names: tuple[str, ...]) -> dict[str, Any]:
    kept = {name: getattr(table, name) for name in names}
    return kept | {"cpu_s": np.array(table.cpu_s)}


def scene_shape(scene: Scene, card: MaterialCard) -> DimensionlessProblem:
    """The shape that serves every force on a scene's punch; ValueError where load paths are not reused."""
    law = material_of(scene, card).law
    try:
        return shape_for(scene, law, sorted({punch.diameter_m for punch in scene.punches}), False)
    except ValueError as error:
        raise ValueError(f"{error} Leave out --reuse: the touch is then solved from rest.") from None


def shape_for(scene: Scene, law: Law, diameters_m: list[float], spans: bool) -> DimensionlessProblem:
    """The shape of all touches of a scene, for these diameters; ValueError where no load path serves them."""
    if scene.hold.time_s:
        raise ValueError("a hold (time_s in [hold]) is solved in time, not along a load path.")
    for punch in scene.punches:
        if punch.friction != "none":
            raise ValueError(f"friction = \"{punch.friction}\" in [punch]: load paths are stored for punches without "
                             "friction only.")
        if not profile_of(punch).is_flat:
            raise ValueError(f"profile = \"{punch.profile}\" in [punch]: load paths are stored for flat "
                             "punches only.")
    shapes = {shape_of(law, scene.body, punch, diameters_m, spans=spans) for punch in scene.punches}
    if len(shapes) > 1:
        raise ValueError("the punches differ in more than their diameters, and a table of load paths serves one kind.")
    return shapes.pop()


def served(table: Table | None, law: Law, scene: Scene) -> tuple[Touch | None, ...]:
    """The touches of a scene that a table holds to the requested error; None for each that is to be solved."""
    if table is None or scene.hold.time_s or (
            table.error.signal(scene.skin.strain) > TABLE_SHARE * scene.accuracy.signal):
        return (None,) * len(scene.punches)
    return tuple(_served(table, law, scene, punch) for punch in scene.punches)


def _served(table: Table, law: Law, scene: Scene, punch: Punch) -> Touch | None:
    touch = touch_from(table, law, scene.body, punch)
    if touch is None or not near_rim(scene, punch):
        return touch
    if table.rim is None:
        return None
    rim = within(table.rim, RIM_SHARE * scene.accuracy.signal, scene.skin.strain)
    table, reach = replace(table, rim=rim), float(rim.gaps[-1])
    if not several_edges(scene, punch):
        return near_rim_from(table, touch, scene.body, punch)
    cost = added_edges_cost(scene, punch, reach)
    return near_edges_from(table, touch, scene.body, punch, cost) if cost <= RIM_SHARE * scene.accuracy.signal else None


def decision(table: Table, touch: Touch, scene: Scene) -> Decision:
    """What a touch from a table may cost, as measured when it was made."""
    error, strain = table.error, scene.skin.strain
    ends = [f"{d * scene.body.thickness_m * 1e3:g}" for d in table.shape.diameters]
    where = f"{ends[0]} to {ends[-1]} mm" if table.shape.spans else f"{', '.join(ends)} mm"
    paths, rim = error.signal(strain), ""
    bound = max(error.depth, paths)
    if touch.rim is not None and touch.rim.error_estimate is not None:
        depth, signal = float(touch.rim.error_estimate[0]), of_strain(touch.rim.error_estimate[1:], strain)
        bound += max(depth, signal)
        rim = (f"; what the rim changes, from a table too, was at most {depth:.1e} off in depth and {signal:.1e} in "
               "signal about this gap and depth")
    bound *= _SAFETY
    return Decision("load path reused", f"depth, pressure and surface are cubics along stored paths of punches of "
                    f"{where}; of {table.checks} touches solved anew between its nodes the depth was at most "
                    f"{error.depth:.1e} off, the dipole response {paths:.1e}, and the surface's stretches "
                    f"{error.strain:.1e} in L2{rim}; the bound is {_SAFETY:g} times the larger of "
                    f"depth and response; the table took {table.whole_cpu_s:.0f} CPU s, once, not counted in the cost "
                    "of a touch", bound, strain_bound=_SAFETY * error.strain)
