"""Tables of touches that are moved along a cylinder, from the cache or solved and put there; and which scenes they
serve."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from eitsim.mechanics.curved.moved_touches import MovedShape, MovedTable, Run, solved_table
from eitsim.mechanics.curved.space_field import Neighbourhood, SpaceField
from eitsim.mechanics.general.meshing.layer_layout import ChartLayout
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.scene import STRAINS
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.simulation.edge_effects import EDGE_SHARE, rim_effect
from eitsim.simulation.routes.on_surface import Pressed
from matcal.laws.law import Law, values_of
from touchcal import cache

_CODE = ("eitsim.mechanics.curved.moved_touches",)
_ARRAYS = ("waves", "ratios", "wall", "stated", "error")


def moved_table(shape: MovedShape, run: Run = map) -> tuple[MovedTable, str]:
    """The table of a shape, from the cache or solved and put there, and a note where the cache cannot be used."""
    def arrays() -> dict[str, Any]:
        made = solved_table(shape, run)
        return {name: getattr(made, name) for name in _ARRAYS} | {"cpu_s": np.array(made.cpu_s)}

    kept, note = cache.kept(_key(shape), arrays)
    waves, ratios, wall, stated, error = (np.asarray(kept[name]) for name in _ARRAYS)
    return MovedTable(shape, waves, ratios, wall, stated, error, float(kept["cpu_s"])), note


def is_stored(shape: MovedShape) -> bool:
    """Whether the cache has the table of a shape."""
    return cache.stored(_key(shape)) is not None


def moved(scene: CurvedScene, law: Law, table: MovedTable) -> Pressed | None:
    """The touch of a scene from a table, with what neglecting the cylinder's ends may cost added to its error; None
    where it does not serve."""
    surface, shape = scene.body.surface, table.shape
    punch = scene.punches[0]
    if not isinstance(surface, Cylinder) or len(scene.punches) > 1 or scene.hold.time_s or not table.serves(punch) or (
            (surface.radius_m, scene.body.thickness_m) != (shape.radius_m, shape.thickness_m)) or (
                _identity(law) != _identity(shape.law)):
        return None
    (place,) = surface.nearest(scene.places_m)[0]
    gap = surface.length_m / 2 - abs(float(place[0])) - punch.diameter_m / 2
    ends = [sum(rim_effect(each, shape.thickness_m, strain) for each in (gap, gap + 2 * abs(float(place[0]))))
            for strain in STRAINS]
    if gap < 0 or rim_effect(gap, shape.thickness_m, scene.skin.strain) > EDGE_SHARE * scene.accuracy.signal:
        return None
    touch, field = table.touch(punch)
    layout = ChartLayout(surface.chart_about(place), shape.thickness_m)
    part = Neighbourhood(layout, field, min(layout.chart.limit_m, field.reach_m))
    return Pressed((replace(touch, signal_errors=touch.signal_errors + ends),), SpaceField((part,)))


def _key(shape: MovedShape) -> str:
    return cache.key_of({**asdict(shape), "law": _identity(shape.law)}, _CODE)


def _identity(law: Law) -> tuple[Any, ...]:
    return law.name, *(tuple(map(float, values)) for values in values_of(law))
