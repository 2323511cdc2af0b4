"""Tables of load paths: which one serves a scene, from the cache or solved and put there."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from eitsim.mechanics.load_paths.build_table import DEPTHS, Run, build
from eitsim.mechanics.load_paths.load_path import Deviation
from eitsim.mechanics.load_paths.table import shape_of
from eitsim.mechanics.load_paths.types import DimensionlessProblem, RimTable, Table
from eitsim.scene.scene import Scene, profile_of
from eitsim.simulation.build_rim_table import GRID, build_rim
from eitsim.simulation.material import material_of
from matcal.card import MaterialCard
from matcal.laws.law import Law
from touchcal import cache
from touchcal.arrays import Array
from touchcal.code_version import MECHANICS

# Arrays of a table and of what the rim changes.
_PATHS = ("depths", "radius", "values", "slopes", "error_estimate")
_CHANGES = ("diameters", "gaps", "depths", "radius", "share", "fields", "numbers", "error_estimate", "measured")


def table_for(shape: DimensionlessProblem, run: Run = map, *, rim: bool = False) -> tuple[Table, str]:
    """The table of a shape, with what the rim changes where that is asked for, from the cache or solved and put there,
    and a note where the cache cannot be used."""
    arrays, note = cache.kept(_key(shape), lambda: _arrays(build(shape, run, DEPTHS)))
    part = {name: np.asarray(arrays[name]) for name in _PATHS}
    table = Table(shape, part["depths"], part["radius"], part["values"], part["slopes"], part["error_estimate"],
                  deviation_of(arrays["error"]), int(arrays["checks"]), float(arrays["cpu_s"]))
    if not rim:
        return table, note
    arrays, words = cache.kept(_key(shape, rim=True), lambda: _kept(build_rim(table, run, GRID), _CHANGES))
    part = {name: np.asarray(arrays[name]) for name in _CHANGES}
    return replace(table, rim=RimTable(**part, cpu_s=float(arrays["cpu_s"]))), note or words


def is_stored(shape: DimensionlessProblem, *, rim: bool) -> bool:
    """Whether the cache has the table of a shape, or what the rim changes."""
    return cache.stored(_key(shape, rim=rim)) is not None


def _key(shape: DimensionlessProblem, *, rim: bool = False) -> str:
    key = {"shape": asdict(shape), "depths": DEPTHS, "arrays": _PATHS}
    return cache.key_of(key | ({"rim": asdict(GRID), "arrays": _CHANGES} if rim else {}), MECHANICS)


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
        if not punch.axisymmetric:
            raise ValueError("tilt_deg and shape in [punch]: load paths are stored for upright punches with a profile "
                             "only.")
        if not profile_of(punch).is_flat:
            raise ValueError(f"profile = \"{punch.profile}\" in [punch]: load paths are stored for flat "
                             "punches only.")
    shapes = {shape_of(law, scene.body, punch, diameters_m, spans=spans) for punch in scene.punches}
    if len(shapes) > 1:
        raise ValueError("the punches differ in more than their diameters, and a table of load paths serves one kind.")
    return shapes.pop()
